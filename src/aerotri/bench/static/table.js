// The table of rays, the worst first; a click goes to the ray in plan and photograph.

import { ask } from "./api.js";
import { button, fixed, guarded, make } from "./dom.js";

const STEP = 500;

// What the user works with is made once and stays: a field in which somebody types must not be replaced.
export class RayTable {
  constructor(bench) {
    this.bench = bench;
    this.filter = "";
    this.first = 0;
    this.asked = 0;
    const apply = guarded(() => this.apply()), turn = by => () => { this.first = Math.max(0, this.first + by); return this.fill(); };
    this.input = make("input", { type: "search", id: "filter", placeholder: "photograph or point", onchange: apply, onkeydown: event => { if (event.key === "Enter") apply(); } });
    this.only = make("input", { type: "checkbox", onchange: guarded(() => { this.first = 0; return this.fill(); }) });
    this.back = button("◂", turn(-STEP), "rows before");
    this.on = button("▸", turn(STEP), "rows after");
    this.shown = make("span");
    this.rows = make("div");
  }

  async render(sheet) {
    sheet.replaceChildren(make("div", { class: "tools" }, this.input, make("label", {}, this.only, " of the chosen point"), this.back, this.on, this.shown), this.rows);
    await this.fill();
  }

  // Leaving the field and Enter both say so: the rows are asked for once.
  async apply() {
    if (this.input.value === this.filter) return;
    this.filter = this.input.value;
    this.first = 0;
    await this.fill();
  }

  // Answers may come in another order than the questions: the last question counts.
  async fill() {
    const asked = ++this.asked, { point } = this.bench.chosen, question = { first: this.first, text: this.filter };
    if (this.only.checked && point !== null) question.point = point;
    const found = await ask("data/rays", question);
    if (asked !== this.asked) return;
    this.back.disabled = !this.first;
    this.on.disabled = this.first + STEP >= found.count;
    this.shown.textContent = `${found.count ? found.first + 1 : 0}–${Math.min(found.first + STEP, found.count)} of ${found.count} rays, the largest |w| first`;
    this.rows.replaceChildren(this.table(found.rows));
  }

  table(rows) {
    const names = this.bench.names, heads = ["|w|", "wx", "wy", "photograph", "point", "column, px", "row, px", "v column, px", "v row, px", "weight", "status"];
    const numeric = new Set([0, 1, 2, 5, 6, 7, 8, 9]);
    const body = make("tbody");
    rows.ray.forEach((ray, k) => {
      const image = rows.image[k], point = rows.point[k], w = rows.w[k], go = guarded(() => this.bench.chooseRay(image, point));
      const state = this.bench.stateOfRay(image, point);
      const cells = [fixed(rows.size[k], 1), fixed(w[0], 1), fixed(w[1], 1), names.images[image], names.points[point],
        fixed(rows.px[k][0], 2), fixed(rows.px[k][1], 2), fixed(rows.v[k][0], 2), fixed(rows.v[k][1], 2), fixed(rows.weight[k], 2), state || rows.status[k]];
      const row = make("tr", { tabIndex: 0, onclick: go, onkeydown: event => { if (event.key === "Enter") go(); } },
        ...cells.map((text, column) => make("td", { class: (column ? "" : "size ") + (numeric.has(column) ? "n" : "") }, text)));
      row.dataset.ray = ray;
      if (rows.size[k] > this.bench.limit) row.classList.add("beyond");
      if (state === "switched off" || state === "removed") row.classList.add("off");
      if (image === this.bench.chosen.image && point === this.bench.chosen.point) row.classList.add("chosen");
      body.append(row);
    });
    return make("table", { id: "rays" }, make("thead", {}, make("tr", {}, ...heads.map((head, k) => make("th", { class: numeric.has(k) ? "n" : "" }, head)))), body);
  }
}
