// The plan: footprints, strips, points by w or sigma, differences at control points, error ellipses.

import { checkbox, choice, slider, make, fixed } from "./dom.js";
import { STEPS, UNKNOWN, sixths, stepOf, limitsOfW } from "./colours.js";
import { BARS_PX, drawBars, showColours } from "./legend.js";
import { Surface } from "./surface.js";

const ELLIPSE_PX = 28;

export class Plan {
  constructor(bench) {
    this.bench = bench;
    this.show = { footprints: true, strips: true, points: true, control: true, vectors: true, ellipses: false };
    this.by = "w";
    this.times = { vectors: 0, ellipses: 0 };
    this.surface = new Surface(document.getElementById("plan"), 1, pen => this.draw(pen));
    this.surface.onclick = at => this.pick(at);
    this.surface.onmove = at => this.hover(at);
  }

  take(content) {
    this.content = content;
    this.points = content.points;
    this.count = content.points.name.length;
    this.x = Float64Array.from(content.points.xyz, p => p[0] ?? NaN);
    this.y = Float64Array.from(content.points.xyz, p => p[1] ?? NaN);
    this.sigma = content.points.sigma.map(s => s[2] === null ? null : Math.hypot(...s));
    this.limits = { w: limitsOfW(), sigma: sixths(this.sigma) };
    this.sort();
    this.times.vectors = this.times.vectors || this.suitable();
    this.bar();
  }

  // Rows of the points by colour, so that a colour is set once for thousands.
  sort() {
    const limits = this.limits[this.by];
    this.groups = [...STEPS, UNKNOWN].map(() => []);
    for (let k = 0; k < this.count; k++) {
      const value = this.by === "w" ? this.points.w[k] : this.sigma[k];
      if (!Number.isNaN(this.x[k])) this.groups[value === null ? STEPS.length : stepOf(Math.abs(value), limits)].push(k);
    }
  }

  bounds() {
    const xs = [], ys = [];
    for (const corner of this.content.images.footprint.flat()) if (corner[0] !== null) { xs.push(corner[0]); ys.push(corner[1]); }
    for (let k = 0; k < this.count; k++) if (!Number.isNaN(this.x[k])) { xs.push(this.x[k]); ys.push(this.y[k]); }
    const least = list => list.reduce((a, b) => Math.min(a, b), Infinity), most = list => list.reduce((a, b) => Math.max(a, b), -Infinity);
    return xs.length ? [[least(xs), least(ys)], [most(xs), most(ys)]] : [[-1, -1], [1, 1]];
  }

  // The whole block beside the legend or above it, whichever shows it larger.
  fit() {
    const legend = document.getElementById("legend"), wide = legend.offsetWidth + 10, tall = legend.offsetHeight + 10;
    this.surface.fit(...this.bounds(), legend.hidden ? [[0, BARS_PX]] : [[wide, BARS_PX], [0, Math.max(tall, BARS_PX)]]);
  }

  // By how much vectors are drawn larger: the longest is a twentieth of the block.
  suitable() {
    const [low, high] = this.bounds();
    const longest = Math.max(1e-9, ...this.content.control.difference.map(d => Math.hypot(d[0] || 0, d[1] || 0)));
    return Math.hypot(high[0] - low[0], high[1] - low[1]) / 20 / longest;
  }

  bar() {
    const set = (name, words, title) => checkbox(words, this.show[name], on => { this.show[name] = on; showColours(this); this.surface.redraw(); if (on) this.bench.wanted(name); }, title);
    const scale = (name, title) => slider("×k", -1.5, 1.5, 0, value => { this.factor[name] = 10 ** value; this.surface.redraw(); }, title);
    this.factor = this.factor || { vectors: 1, ellipses: 1 };
    document.getElementById("plan-bar").replaceChildren(
      make("span", { class: "title" }, "Plan"),
      set("footprints", "footprints", "Photographs on the mean height of their points"), set("strips", "strips"),
      set("points", "points"),
      choice("by", { w: "|w|", sigma: "σ" }, this.by, by => { this.by = by; this.sort(); showColours(this); this.surface.redraw(); }),
      set("control", "control"), set("vectors", "differences", "Adjusted − given of control and check points, drawn larger"),
      scale("vectors", "How much larger differences are drawn"),
      set("ellipses", "ellipses", "Error ellipses of the points in plan, drawn larger; one in every square, all when you zoom in"), scale("ellipses", "How much larger ellipses are drawn"),
      make("button", { type: "button", onclick: () => this.fit() }, "whole block"),
      ...(this.more || []));
    showColours(this);
  }

  draw(pen) {
    if (!this.content) return;
    this.under(pen);
    if (this.show.footprints) this.drawFootprints(pen);
    if (this.show.strips) this.drawStrips(pen);
    if (this.show.ellipses && this.ellipses) this.drawEllipses(pen);
    if (this.show.points) this.drawPoints(pen);
    if (this.show.control) this.drawControl(pen);
    if (this.show.vectors) this.drawVectors(pen);
    this.drawChosen(pen);
    drawBars(pen, this);
  }

  // Surfaces and orthophotos: a picture each, asked for when it is to be seen.
  takeLayers(layers) {
    this.layers = layers.map((layer, k) => ({ ...layer, number: k, shown: false, picture: null }));
    this.more = this.layers.map(layer => checkbox(layer.name, false, on => {
      layer.shown = on;
      if (!layer.picture) {
        layer.picture = new Image();
        layer.picture.onload = () => this.surface.redraw();
        layer.picture.src = `layer/${layer.number}`;
      }
      this.surface.redraw();
    }));
    this.bar();
  }

  under(pen) {
    for (const layer of this.layers || []) {
      if (!layer.shown || !layer.picture.complete || !layer.picture.naturalWidth) continue;
      const [left, bottom, right, top] = layer.bounds, [x, y] = this.surface.screen(left, top), [u, v] = this.surface.screen(right, bottom);
      pen.drawImage(layer.picture, x, y, u - x, v - y);
    }
  }

  outline(pen, corners) {
    if (corners[0][0] === null) return;
    corners.forEach((corner, k) => { const [x, y] = this.surface.screen(...corner); if (k) pen.lineTo(x, y); else pen.moveTo(x, y); });
    pen.closePath();
  }

  drawFootprints(pen) {
    pen.beginPath();
    for (const corners of this.content.images.footprint) this.outline(pen, corners);
    pen.strokeStyle = "#7c8ea84d";
    pen.lineWidth = 1;
    pen.stroke();
  }

  drawStrips(pen) {
    pen.beginPath();
    for (const strip of this.content.strips) {
      strip.images.forEach((image, k) => {
        const [x, y] = this.surface.screen(...this.content.images.centre[image]);
        if (k) pen.lineTo(x, y); else pen.moveTo(x, y);
      });
    }
    pen.strokeStyle = "#3b4a5c80";
    pen.stroke();
    pen.fillStyle = "#3b4a5c";
    for (const centre of this.content.images.centre) {
      if (centre[0] === null) continue;
      const [x, y] = this.surface.screen(...centre);
      pen.fillRect(x - 1, y - 1, 2, 2);
    }
  }

  drawPoints(pen) {
    const s = this.surface, size = Math.min(Math.max(1.5 + Math.log2(1 + s.scale) * 1.5, 2), 7), half = size / 2;
    const width = s.width, height = s.height, cx = width / 2 - s.x * s.scale, cy = height / 2 + s.y * s.scale;
    this.groups.forEach((rows, colour) => {
      pen.fillStyle = colour < STEPS.length ? STEPS[colour] : UNKNOWN;
      for (const k of rows) {
        const x = cx + this.x[k] * s.scale, y = cy - this.y[k] * s.scale;
        if (x > -size && y > -size && x < width + size && y < height + size) pen.fillRect(x - half, y - half, size, size);
      }
    });
  }

  place(point) {
    if (!Number.isNaN(this.x[point])) return [this.x[point], this.y[point]];
    const row = this.content.control.point.indexOf(point), given = row < 0 ? null : this.content.control.xyz[row];
    return given && given[0] !== null && given[1] !== null ? [given[0], given[1]] : null;
  }

  drawControl(pen) {
    const names = [];
    for (const point of this.content.control.point) {
      const at = this.place(point);
      if (!at) continue;
      const [x, y] = this.surface.screen(...at), check = this.points.role[point] === 2;
      pen.beginPath();
      if (check) pen.arc(x, y, 6, 0, 7);
      else { pen.moveTo(x, y - 7); pen.lineTo(x + 6, y + 5); pen.lineTo(x - 6, y + 5); pen.closePath(); }
      pen.strokeStyle = "#111";
      pen.lineWidth = 1.5;
      pen.fillStyle = check ? "#fff" : "#ffd84d";
      pen.fill();
      pen.stroke();
      names.push([this.points.name[point], x + 9, y + 4]);
    }
    this.drawNames(pen, names);
  }

  // A name that would lie over an earlier one is left out: a larger scale shows it.
  drawNames(pen, names) {
    const taken = [];
    pen.font = "12px system-ui, sans-serif";
    pen.strokeStyle = "#ffffffd0";
    pen.lineWidth = 3;
    pen.fillStyle = "#111";
    for (const [name, x, y] of names) {
      const box = [x, y - 10, x + pen.measureText(name).width, y + 3];
      if (taken.some(other => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3])) continue;
      taken.push(box);
      pen.strokeText(name, x, y);
      pen.fillText(name, x, y);
    }
  }

  drawVectors(pen) {
    const k = this.times.vectors * this.factor.vectors;
    pen.lineWidth = 1.5;
    this.content.control.point.forEach((point, row) => {
      const d = this.content.control.difference[row], at = this.place(point);
      if (!at) return;
      const [x, y] = this.surface.screen(...at);
      const line = (dx, dy, colour) => {
        const [u, v] = this.surface.screen(at[0] + k * dx, at[1] + k * dy);
        pen.beginPath(); pen.moveTo(x, y); pen.lineTo(u, v); pen.strokeStyle = colour; pen.stroke();
      };
      if (d[0] !== null && d[1] !== null) line(d[0], d[1], "#b3001b");
      if (d[2] !== null) line(0, d[2], "#0b63b8");
    });
  }

  drawEllipses(pen) {
    const k = this.ellipses.k * this.factor.ellipses, s = this.surface;
    pen.strokeStyle = "#5a2d82";
    pen.lineWidth = 0.8;
    pen.beginPath();
    // one in every square of the ground: all of them would cover one another
    const side = ELLIPSE_PX / s.scale, taken = new Set();
    this.ellipses.point.forEach((point, row) => {
      const [x, y] = s.screen(this.x[point], this.y[point]);
      if (x < -50 || y < -50 || x > s.width + 50 || y > s.height + 50) return;
      const square = `${Math.floor(this.x[point] / side)} ${Math.floor(this.y[point] / side)}`;
      if (taken.has(square)) return;
      taken.add(square);
      const a = this.ellipses.a[row] * k * s.scale, b = this.ellipses.b[row] * k * s.scale, turn = this.ellipses.azimuth[row] - Math.PI / 2;
      pen.moveTo(x + a * Math.cos(turn), y + a * Math.sin(turn));
      pen.ellipse(x, y, a, b, turn, 0, 2 * Math.PI);
    });
    pen.stroke();
  }

  drawChosen(pen) {
    const { image, point } = this.bench.chosen;
    if (image !== null) {
      pen.beginPath();
      this.outline(pen, this.content.images.footprint[image]);
      pen.strokeStyle = "#0b63b8";
      pen.lineWidth = 2;
      pen.stroke();
    }
    const at = point === null ? null : this.place(point);
    if (!at) return;
    const [x, y] = this.surface.screen(...at);
    pen.beginPath();
    for (const other of this.bench.imagesOfPoint || []) {
      const centre = this.content.images.centre[other];
      if (centre[0] === null) continue;
      pen.moveTo(x, y);
      pen.lineTo(...this.surface.screen(...centre));
    }
    pen.strokeStyle = "#0b63b880";
    pen.lineWidth = 1;
    pen.stroke();
    pen.beginPath();
    pen.arc(x, y, 9, 0, 7);
    pen.strokeStyle = "#0b63b8";
    pen.lineWidth = 2.5;
    pen.stroke();
  }

  nearest(at, within) {
    let found = null, least = (within / this.surface.scale) ** 2;
    for (let k = 0; k < this.count; k++) {
      const place = this.points.role[k] && Number.isNaN(this.x[k]) ? this.place(k) : null;
      const dx = (place ? place[0] : this.x[k]) - at[0], dy = (place ? place[1] : this.y[k]) - at[1], d = dx * dx + dy * dy;
      if (d < least) { least = d; found = k; }
    }
    return found;
  }

  nearestImage(at) {
    let found = null, least = Infinity;
    this.content.images.centre.forEach((centre, k) => {
      if (centre[0] === null) return;
      const d = Math.hypot(centre[0] - at[0], centre[1] - at[1]);
      if (d < least) { least = d; found = k; }
    });
    return found;
  }

  pick(at) {
    const point = this.nearest(at, 10);
    if (point !== null) this.bench.choosePoint(point);
    else { const image = this.nearestImage(at); if (image !== null) this.bench.chooseImage(image); }
  }

  hover(at) {
    const point = this.content ? this.nearest(at, 10) : null, hint = document.getElementById("plan-hint");
    if (point === null) { hint.textContent = ""; return; }
    const s = this.points.sigma[point].map(value => fixed(value, 3) || "–");
    hint.textContent = `${this.points.name[point]}: ${this.points.rays[point]} rays, largest |w| ${fixed(this.points.w[point], 1) || "–"}, σ ${s.join(" ")} m`;
  }
}
