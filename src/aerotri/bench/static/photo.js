// A photograph in full resolution with measured and predicted points, residuals, epipolar lines, and marks to move.

import { ask, tell } from "./api.js";
import { button, checkbox, choice, fixed, guarded, make, slider } from "./dom.js";
import { colourOfW } from "./colours.js";
import { drawPhotoBars } from "./legend.js";
import { cross, label, line, ring } from "./marks.js";
import { Surface } from "./surface.js";
import { Tiles } from "./tiles.js";

const MOVED = "#ffb000", PREDICTED = "#53d0ff", CHOSEN = "#ffffff", EPIPOLAR = "#7dff7a", TARGET = "#ff9df5";
const NEAR_PX = 9, CLOSE = 2;

export class Photo {
  constructor(bench) {
    this.bench = bench;
    this.times = 10;
    this.brightness = 1;
    this.contrast = 1;
    this.show = { marks: true, residuals: true, predicted: true, names: false, epipolar: true, snap: true };
    this.setting = false;
    this.lines = [];
    this.targets = [];
    this.surface = new Surface(document.getElementById("photo"), -1, pen => this.draw(pen));
    this.surface.onclick = guarded(at => this.click(at));
    this.surface.onmove = at => this.hover(at);
    this.surface.ondragmark = (phase, at, event) => this.drag(phase, at, event);
    this.bar();
  }

  async open(image, point = null) {
    if (!this.content || this.content.image !== image || this.generation !== this.bench.generation) {
      const content = await ask(`data/photograph/${image}`);
      const other = !this.content || this.content.image !== image;
      this.content = content;
      this.generation = this.bench.generation;
      if (other) {
        this.targets = [];
        this.tiles = content.has_file ? new Tiles(image, content.size, () => this.surface.redraw()) : null;
        this.surface.fit([0, 0], content.size);
      }
      this.bar();
    }
    const at = point === null ? null : this.placeOf(point);
    if (at) this.look(at);
    await this.epipolar();
    this.surface.redraw();
  }

  look(at) {
    this.surface.x = at[0];
    this.surface.y = at[1];
    this.surface.scale = Math.max(this.surface.scale, CLOSE);
    this.surface.redraw();
  }

  async epipolar() {
    const { point } = this.bench.chosen;
    this.lines = [];
    if (this.content && point !== null && this.show.epipolar) this.lines = (await ask(`data/epipolar/${this.content.image}/${point}`)).lines;
    this.surface.redraw();
  }

  bar() {
    const set = (name, words, title) => checkbox(words, this.show[name], guarded(async on => { this.show[name] = on; if (name === "epipolar") await this.epipolar(); this.surface.redraw(); }), title);
    const tune = (name, words) => slider(words, -1, 1, Math.log10(this[name]), value => { this[name] = 10 ** value; this.surface.redraw(); }, "Of the photograph; cut-outs follow when they are drawn anew");
    const names = this.bench.names ? Object.fromEntries(this.bench.names.images.map((name, k) => [k, name])) : {};
    const image = this.content ? String(this.content.image) : "";
    const turn = by => () => this.bench.chooseImage((+image + by + this.bench.names.images.length) % this.bench.names.images.length);
    const mark = button(this.setting ? "Click the point" : "Set mark", () => this.beginSetting(), "Then click on the chosen point in the photograph (key M)");
    mark.id = "set-mark";
    const name = this.bench.names ? this.bench.nameToMark() : null;
    mark.disabled = !this.content || name === null;
    const find = button("Find coded targets", () => this.findTargets(), "Crosses with a number: squares of ArUco and AprilTag, rings of 12 and 14 bits");
    find.id = "find-targets";
    find.disabled = !this.tiles;
    document.getElementById("photo-bar").replaceChildren(
      choice("", { "": "photograph", ...names }, image, guarded(value => value === "" ? null : this.bench.chooseImage(+value))),
      ...(this.content ? [button("◂", turn(-1), "photograph before"), button("▸", turn(1), "next photograph")] : []),
      mark, find, ...this.targetButtons(), set("snap", "snap", "A mark is moved to where the other photographs of the point, or a target, say it is"),
      set("marks", "marks"), set("predicted", this.bench.summary && this.bench.summary.is_rough ? "predicted (roughly)" : "predicted", "Where points should appear; before the first adjustment by start values, or by positions and attitudes of GNSS and INS"), set("residuals", "residuals"),
      slider("×k", 0, 3, Math.log10(this.times), value => { this.times = 10 ** value; this.surface.redraw(); }, "How much larger residuals are drawn"),
      set("epipolar", "epipolar lines", "Rays of the chosen point in other photographs"), set("names", "names"),
      tune("brightness", "brightness"), tune("contrast", "contrast"),
      button("1:1", () => { this.surface.scale = 1; this.surface.redraw(); }),
      button("whole", () => this.content && this.surface.fit([0, 0], this.content.size)));
  }

  async findTargets() {
    this.bench.note("Looking for coded targets …");
    this.targets = (await ask(`data/targets/${this.content.image}`)).targets;
    const known = this.targets.filter(one => one.point).length;
    this.bench.note(this.targets.length ? `${this.targets.length} coded targets, ${known} of control points.` : "No coded target was found in this photograph.");
    document.body.dataset.targets = this.targets.length;
    this.bar();
    this.surface.redraw();
  }

  targetButtons() {
    const known = this.targets.filter(one => one.point).length;
    if (!known) return [];
    const here = button(`Mark ${known} here`, () => this.markTargets([this.content.image]), "Marks the control points whose numbers were read");
    here.id = "mark-targets";
    return [here, button("in all photographs", () => this.markTargets(this.bench.summary.pictures), "Looks for coded targets in every photograph and marks their control points")];
  }

  async markTargets(images) {
    let count = 0, done = 0;
    for (const image of images) {
      const found = await tell("act/mark_targets", { image });
      count += found.marked.length;
      done += 1;
      this.bench.note(`${count} marks, ${done} of ${images.length} photographs`);
      if (done === images.length) await this.bench.decided(found);
    }
  }

  drawTargets(pen) {
    for (const one of this.targets) {
      const [x, y] = this.surface.screen(...one.place);
      line(pen, [[x - 10, y - 10], [x + 10, y - 10], [x + 10, y + 10], [x - 10, y + 10], [x - 10, y - 10]], one.point ? TARGET : "#d0d0d0");
      label(pen, one.point ? `${one.number} = ${one.point}` : String(one.number), x + 14, y - 12, one.point ? TARGET : "#d0d0d0");
    }
  }

  beginSetting() {
    this.setting = !this.setting;
    this.bar();
  }

  // Where a point is measured, or was marked since, or is predicted.
  placeOf(point) {
    const changed = this.changes().find(one => one.point === point && one.px);
    if (changed) return changed.px;
    const row = this.content.rays.point.indexOf(point);
    if (row >= 0) return this.content.rays.px[row];
    const expected = this.expected(point);
    return expected || null;
  }

  expected(point) {
    const found = this.content.expected.find(one => one[0] === point);
    if (found) return [found[1], found[2]];
    const own = point === this.bench.chosen.point && this.bench.pointContent;
    const there = own && own.expected.find(one => one[0] === this.content.image);
    return there ? [there[1], there[2]] : null;
  }

  changes() {
    return this.bench.changes.filter(one => one.image === this.content.image);
  }

  draw(pen) {
    if (!this.content) return;
    const s = this.surface, [x, y] = s.screen(0, 0);
    pen.fillStyle = "#565c63";
    pen.fillRect(x, y, this.content.size[0] * s.scale, this.content.size[1] * s.scale);
    if (this.tiles) {
      pen.filter = this.filter();
      this.tiles.draw(pen, s);
      pen.filter = "none";
    }
    if (this.show.epipolar) for (const one of this.lines) line(pen, one.line.map(at => s.screen(...at)), EPIPOLAR, 1);
    if (this.show.predicted) this.drawExpected(pen);
    if (this.show.marks) this.drawRays(pen);
    this.drawTargets(pen);
    this.drawChanges(pen);
    this.drawChosen(pen);
    drawPhotoBars(pen, this);
  }

  filter() {
    return this.brightness === 1 && this.contrast === 1 ? "none" : `brightness(${this.brightness}) contrast(${this.contrast})`;
  }

  drawExpected(pen) {
    const measured = new Set(this.content.rays.point);
    for (const [point, column, row] of this.content.expected) {
      if (measured.has(point)) continue;
      const [x, y] = this.surface.screen(column, row);
      ring(pen, x, y, 9, PREDICTED);
      label(pen, this.bench.names.points[point], x + 12, y + 4, PREDICTED);
    }
  }

  drawRays(pen) {
    const rays = this.content.rays, s = this.surface;
    const hidden = new Set(this.changes().filter(one => one.kind === "moved" || one.kind === "removed").map(one => one.point));
    rays.px.forEach((px, k) => {
      const [x, y] = s.screen(...px), colour = rays.status[k] === "used" ? colourOfW(rays.size[k]) : "#b0b0b0", v = rays.v[k];
      if (x < -20 || y < -20 || x > s.width + 20 || y > s.height + 20 || hidden.has(rays.point[k])) return;
      if (this.show.residuals && v[0] !== null) line(pen, [[x, y], s.screen(px[0] + v[0] * this.times, px[1] + v[1] * this.times)], colour, 1.2);
      cross(pen, x, y, 6, colour);
      if (this.show.predicted && v[0] !== null && s.scale > 4) ring(pen, ...s.screen(px[0] + v[0], px[1] + v[1]), 4, PREDICTED, 1);
      if (this.show.names) label(pen, this.bench.names.points[rays.point[k]], x + 8, y - 6, colour);
    });
  }

  drawChanges(pen) {
    for (const one of this.changes()) {
      const was = one.point === null ? -1 : this.content.rays.point.indexOf(one.point);
      const before = was < 0 ? null : this.surface.screen(...this.content.rays.px[was]);
      if (one.px) {
        const at = this.surface.screen(...one.px);
        if (before) line(pen, [before, at], MOVED, 1);
        cross(pen, ...at, 9, MOVED, 2);
        label(pen, one.name, at[0] + 10, at[1] - 8, MOVED);
      } else if (before) {
        const [x, y] = before;
        line(pen, [[x - 7, y - 7], [x + 7, y + 7]], MOVED);
        line(pen, [[x - 7, y + 7], [x + 7, y - 7]], MOVED);
      }
    }
  }

  drawChosen(pen) {
    const { point } = this.bench.chosen, at = point === null ? null : this.placeOf(point);
    if (!at) return;
    const [x, y] = this.surface.screen(...at);
    ring(pen, x, y, 14, CHOSEN, 1.5);
    label(pen, this.bench.names.points[point], x + 17, y + 5, CHOSEN);
  }

  nearest(at) {
    const candidates = this.content.rays.px.map((px, k) => [this.content.rays.point[k], px]);
    for (const one of this.content.expected) candidates.push([one[0], [one[1], one[2]]]);
    for (const one of this.changes()) if (one.px && one.point !== null) candidates.push([one.point, one.px]);
    let found = null, least = NEAR_PX / this.surface.scale;
    for (const [point, px] of candidates) {
      const far = Math.hypot(px[0] - at[0], px[1] - at[1]);
      if (far < least) { least = far; found = point; }
    }
    return found;
  }

  async click(at) {
    if (!this.content) return;
    if (this.setting) {
      this.setting = false;
      await this.bench.setMark(this.content.image, this.bench.nameToMark(), at, this.show.snap);
      this.bar();
      return;
    }
    const point = this.nearest(at);
    if (point !== null) await this.bench.choosePoint(point);
  }

  // The chosen mark follows the mouse; the others move the photograph.
  drag(phase, at) {
    if (!this.content || this.setting) return false;
    const { point } = this.bench.chosen;
    if (phase === "begin") return this.bench.newPoint === null && point !== null && this.isMarked(point) && this.nearest(at) === point;
    this.dragged = at;
    if (phase === "end") {
      this.dragged = null;
      guarded(() => this.bench.setMark(this.content.image, this.bench.names.points[point], at, this.show.snap))();
    }
    this.surface.redraw();
    return true;
  }

  isMarked(point) {
    return this.content.rays.point.includes(point) || this.changes().some(one => one.point === point && one.px);
  }

  hover(at) {
    const hint = document.getElementById("photo-hint");
    if (!this.content) { hint.textContent = ""; return; }
    const point = this.nearest(at), row = point === null ? -1 : this.content.rays.point.indexOf(point);
    const where = `column ${fixed(at[0], 1)}, row ${fixed(at[1], 1)}`;
    hint.textContent = row < 0 ? where
      : `${this.bench.names.points[point]}: |w| ${fixed(this.content.rays.size[row], 1) || "–"}, v ${fixed(this.content.rays.v[row][0], 2)} ${fixed(this.content.rays.v[row][1], 2)} px · ${where}`;
  }
}
