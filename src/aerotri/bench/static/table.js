// The table of rays, the worst first; a click goes to the ray in plan and photograph.

import { ask } from "./api.js";
import { button, fixed, guarded, make } from "./dom.js";

export class RayTable {
  constructor(bench) {
    this.bench = bench;
    this.filter = "";
    this.only = false;
    this.first = 0;
  }

  async render(sheet) {
    const chosen = this.bench.chosen, question = { first: this.first, text: this.filter };
    if (this.only && chosen.point !== null) question.point = chosen.point;
    const found = await ask("data/rays", question);
    const rows = found.rows, step = 500;
    const input = make("input", { type: "search", id: "filter", placeholder: "photograph or point", value: this.filter, onchange: guarded(async event => {
      this.filter = event.target.value; this.first = 0; await this.render(sheet); }) });
    const only = make("label", {}, make("input", { type: "checkbox", checked: this.only, onchange: guarded(async event => {
      this.only = event.target.checked; this.first = 0; await this.render(sheet); }) }), " of the chosen point");
    const turn = by => async () => { this.first = Math.max(0, this.first + by); await this.render(sheet); };
    const back = button("◂", turn(-step), "rows before"), on = button("▸", turn(step), "rows after");
    back.disabled = !this.first;
    on.disabled = this.first + step >= found.count;
    const shown = `${found.count ? found.first + 1 : 0}–${Math.min(found.first + step, found.count)} of ${found.count} rays, the largest |w| first`;
    sheet.replaceChildren(make("div", { class: "tools" }, input, only, back, on, make("span", {}, shown)), this.table(rows));
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
