// The map of a plan: cells coloured by what is expected, area, strips, exposures, footprints and control.

import { checkbox, choice, fixed, make } from "./dom.js";
import { STEPS, sixths, stepOf } from "./colours.js";
import { Surface } from "./surface.js";

const LAYERS = { sigma_z: ["σ of Z", "cm"], shared_z: ["σ of Z, part that neighbours share", "cm"], sigma_x: ["σ of X", "cm"], sigma_y: ["σ of Y", "cm"], photographs: ["photographs", ""] };

export class FlightMap {
  constructor(bench) {
    this.bench = bench;
    this.layer = "sigma_z";
    this.show = { cells: true, strips: true, exposures: true, footprints: false, control: true };
    this.chosen = null;
    this.surface = new Surface(document.getElementById("plan"), 1, pen => this.draw(pen));
    this.surface.onmove = at => this.hover(at);
  }

  take(content) {
    this.content = content;
    this.chosen = null;
    this.colour();
    this.bar();
    this.surface.redraw();
  }

  // Steps of even number of cells; photographs are whole numbers and have steps of their own.
  colour() {
    const values = this.content.cells.values[this.layer];
    this.limits = [...new Set(sixths(values))];
    this.steps = values.map(value => value === null ? -1 : stepOf(value, this.limits));
    const [words, unit] = LAYERS[this.layer], text = value => unit === "cm" ? fixed(100 * value, 2) : fixed(value, 0);
    const names = [...this.limits, null].map((limit, k) => k === this.limits.length ? `${text(this.limits[k - 1])} and more` : `below ${text(limit)}`);
    document.getElementById("legend").replaceChildren(make("b", {}, unit ? `${words}, ${unit}` : words),
      ...names.map((name, k) => { const key = make("i"); key.style.background = this.paint(k); return make("span", {}, key, name); }));
  }

  // Few photographs are bad, a large sigma is: the colours are turned.
  paint(step) {
    const list = this.layer === "photographs" ? [...STEPS].reverse() : STEPS;
    return list[Math.round(step * (STEPS.length - 1) / Math.max(this.limits.length, 1))];
  }

  bar() {
    const set = (name, words, title) => checkbox(words, this.show[name], on => { this.show[name] = on; this.surface.redraw(); }, title);
    const layers = Object.fromEntries(Object.entries(LAYERS).map(([key, [words]]) => [key, words]));
    document.getElementById("plan-bar").replaceChildren(
      set("cells", "map of"), choice("", layers, this.layer, layer => { this.layer = layer; this.colour(); this.surface.redraw(); }),
      set("strips", "strips"), set("exposures", "exposures"), set("footprints", "footprints", "On level ground at the height below each photograph"), set("control", "control"),
      make("button", { type: "button", onclick: () => this.fit() }, "whole plan"));
  }

  fit() {
    const xs = [], ys = [];
    for (const [x, y] of [...this.content.exposures.xy, ...this.content.area.flat()]) { xs.push(x); ys.push(y); }
    this.surface.fit([Math.min(...xs), Math.min(...ys)], [Math.max(...xs), Math.max(...ys)]);
  }

  draw(pen) {
    if (!this.content) return;
    if (this.show.cells) this.drawCells(pen);
    this.lines(pen, this.content.area, "#111", 2, true);
    if (this.show.footprints) this.lines(pen, this.content.footprints, "#7c8ea860", 1, true);
    if (this.show.strips) this.lines(pen, this.content.strips.map(one => one.line), "#3b4a5cb0", 1, false);
    if (this.show.exposures) this.drawExposures(pen);
    if (this.show.control) this.drawControl(pen);
  }

  drawCells(pen) {
    const { xy, size } = this.content.cells, side = size * this.surface.scale + 0.5;
    xy.forEach(([x, y], k) => {
      if (this.steps[k] < 0) return;
      const [u, v] = this.surface.screen(x - size / 2, y + size / 2);
      pen.fillStyle = this.paint(this.steps[k]);
      pen.fillRect(u, v, side, side);
    });
  }

  lines(pen, paths, colour, width, closed) {
    pen.beginPath();
    for (const path of paths) {
      path.forEach((at, k) => { const [x, y] = this.surface.screen(...at); if (k) pen.lineTo(x, y); else pen.moveTo(x, y); });
      if (closed) pen.closePath();
    }
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.stroke();
  }

  drawExposures(pen) {
    pen.fillStyle = "#1b2430";
    for (const at of this.content.exposures.xy) { const [x, y] = this.surface.screen(...at); pen.fillRect(x - 1.5, y - 1.5, 3, 3); }
  }

  drawControl(pen) {
    pen.font = "12px system-ui, sans-serif";
    this.content.control.forEach((one, k) => {
      const [x, y] = this.surface.screen(...one.xy), text = one.order ? `${one.point} (${one.order})` : one.point;
      pen.beginPath();
      pen.moveTo(x, y - 8); pen.lineTo(x + 7, y + 6); pen.lineTo(x - 7, y + 6); pen.closePath();
      pen.fillStyle = k === this.chosen ? "#0b63b8" : "#ffd84d";
      pen.fill();
      pen.strokeStyle = "#111";
      pen.lineWidth = 1.5;
      pen.stroke();
      pen.strokeStyle = "#ffffffd0";
      pen.lineWidth = 3;
      pen.strokeText(text, x + 10, y + 4);
      pen.fillStyle = "#111";
      pen.fillText(text, x + 10, y + 4);
    });
  }

  choose(control) {
    this.chosen = control;
    [this.surface.x, this.surface.y] = this.content.control[control].xy;
    this.surface.redraw();
  }

  hover(at) {
    const hint = document.getElementById("plan-hint"), { xy, size, values } = this.content.cells;
    const cell = xy.findIndex(([x, y]) => Math.abs(x - at[0]) <= size / 2 && Math.abs(y - at[1]) <= size / 2);
    if (cell < 0) { hint.textContent = ""; return; }
    const cm = name => fixed(100 * values[name][cell], 2);
    hint.textContent = `σ X ${cm("sigma_x")}, Y ${cm("sigma_y")}, Z ${cm("sigma_z")} cm (${cm("shared_z")} cm shared with neighbours), ${fixed(values.photographs[cell], 0)} photographs`;
  }
}
