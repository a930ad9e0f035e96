// A canvas that is moved with the mouse and scaled with the wheel; it draws when something changed.

export class Surface {
  // up: +1 where y points up in the content, -1 where it points down.
  constructor(canvas, up, draw) {
    this.canvas = canvas;
    this.up = up;
    this.paint = draw;
    this.scale = 1;
    this.x = 0;
    this.y = 0;
    this.pending = false;
    this.onclick = this.onmove = this.ondragmark = () => false;
    this.listen();
    new ResizeObserver(() => this.redraw()).observe(canvas);
  }

  listen() {
    const canvas = this.canvas;
    let held = null;
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.zoom(event.offsetX, event.offsetY, Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("pointerdown", event => {
      const at = this.content(event.offsetX, event.offsetY);
      held = { x: event.offsetX, y: event.offsetY, moved: false, mark: this.ondragmark("begin", at, event) };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", event => {
      if (!held) { this.onmove(this.content(event.offsetX, event.offsetY), event); return; }
      const dx = event.offsetX - held.x, dy = event.offsetY - held.y;
      if (!held.moved && Math.hypot(dx, dy) < 4) return;
      held.moved = true;
      if (held.mark) { this.ondragmark("move", this.content(event.offsetX, event.offsetY), event); return; }
      this.x -= dx / this.scale;
      this.y += this.up * dy / this.scale;
      held.x = event.offsetX;
      held.y = event.offsetY;
      this.redraw();
    });
    canvas.addEventListener("pointerup", event => {
      const at = this.content(event.offsetX, event.offsetY), was = held;
      held = null;
      if (!was) return;
      if (was.mark && was.moved) this.ondragmark("end", at, event);
      else if (!was.moved) this.onclick(at, event);
    });
    canvas.addEventListener("pointercancel", () => { held = null; });
  }

  get width() { return this.canvas.clientWidth; }
  get height() { return this.canvas.clientHeight; }

  content(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - this.up * (py - this.height / 2) / this.scale];
  }

  screen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - this.up * (y - this.y) * this.scale];
  }

  zoom(px, py, times) {
    const before = this.content(px, py);
    this.scale = Math.min(Math.max(this.scale * times, 1e-6), 400);
    const after = this.content(px, py);
    this.x += before[0] - after[0];
    this.y += before[1] - after[1];
    this.redraw();
  }

  // rooms: pixels to keep free on the right and below, the one taken that shows the content largest.
  fit(low, high, rooms = [[0, 0]]) {
    const wide = Math.max(high[0] - low[0], 1e-9), tall = Math.max(high[1] - low[1], 1e-9);
    const fitted = rooms.map(([right, below]) => {
      const scale = 0.94 * Math.min(Math.max(this.width - right, 50) / wide, Math.max(this.height - below, 50) / tall);
      return { scale, x: (low[0] + high[0] + right / scale) / 2, y: (low[1] + high[1] - this.up * below / scale) / 2 };
    });
    Object.assign(this, fitted.reduce((best, one) => one.scale > best.scale ? one : best));
    this.redraw();
  }

  redraw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.drawNow(); });
  }

  drawNow() {
    const ratio = window.devicePixelRatio || 1, canvas = this.canvas;
    const wide = Math.round(this.width * ratio), tall = Math.round(this.height * ratio);
    if (canvas.width !== wide || canvas.height !== tall) { canvas.width = wide; canvas.height = tall; }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    this.paint(pen);
  }
}
