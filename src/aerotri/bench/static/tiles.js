// The pixels of a photograph from tiles: the level that fits the scale, coarser ones until it is there.

const TILE = 512, MOST = 400;

export class Tiles {
  constructor(image, size, ready) {
    this.image = image;
    this.size = size;
    this.ready = ready;
    this.kept = new Map();
    this.levels = 1;
    for (let longest = Math.max(...size); longest > TILE; longest = Math.ceil(longest / 2)) this.levels++;
  }

  get(level, column, row) {
    const key = `${level}/${column}/${row}`;
    let tile = this.kept.get(key);
    if (!tile) {
      tile = new Image();
      tile.onload = () => this.ready();
      tile.src = `tile/${this.image}/${key}`;
      this.kept.set(key, tile);
      if (this.kept.size > MOST) this.kept.delete(this.kept.keys().next().value);
    }
    return tile;
  }

  draw(pen, surface) {
    const ratio = window.devicePixelRatio || 1;
    const wanted = Math.min(Math.max(Math.floor(-Math.log2(surface.scale * ratio)), 0), this.levels - 1);
    pen.imageSmoothingEnabled = surface.scale < 3;
    for (let level = this.levels - 1; level >= wanted; level--) {
      if (level === wanted || level === this.levels - 1) this.drawLevel(pen, surface, level);
    }
  }

  drawLevel(pen, surface, level) {
    const step = TILE * 2 ** level, [left, top] = surface.content(0, 0), [right, bottom] = surface.content(surface.width, surface.height);
    const last = axis => Math.ceil(this.size[axis] / step) - 1;
    for (let row = Math.max(0, Math.floor(top / step)); row <= Math.min(last(1), Math.floor(bottom / step)); row++) {
      for (let column = Math.max(0, Math.floor(left / step)); column <= Math.min(last(0), Math.floor(right / step)); column++) {
        const tile = this.get(level, column, row);
        if (!tile.complete || !tile.naturalWidth) continue;
        const [x, y] = surface.screen(column * step, row * step), times = 2 ** level * surface.scale;
        pen.drawImage(tile, x, y, tile.naturalWidth * times, tile.naturalHeight * times);
      }
    }
  }
}
