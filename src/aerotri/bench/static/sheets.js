// Decisions so far, and what the last adjustment changed.

import { ask } from "./api.js";
import { button, fixed, make } from "./dom.js";

const KINDS = { moved: "mark moved", new: "mark set", removed: "mark removed", off: "switched off", on: "switched on", check: "used as check point", control: "used as control point" };

export class EditSheet {
  constructor(bench) { this.bench = bench; }

  render(sheet) {
    const { rows, file, changes } = this.bench.edits;
    const pair = place => place ? `${fixed(place[0], 2)}, ${fixed(place[1], 2)}` : "";
    const body = rows.map(one => make("tr", { class: one.stands ? "" : "off" },
      ...[one.time.replace("T", " ").slice(0, 19), one.action, one.image, one.point, pair(one.place), pair(one.before), one.reason].map(text => make("td", {}, text))));
    const heads = ["time (UTC)", "what", "photograph", "point", "column, row", "before", "reason"];
    const open = changes.map(one => make("li", {}, `${KINDS[one.kind]}: ${one.name}${one.image === null ? "" : ` in ${this.bench.names.images[one.image]}`}${one.reason ? ` (${one.reason})` : ""}`));
    sheet.replaceChildren(
      make("p", {}, rows.length ? `Saved in ${file}. What was taken back is struck out.` : `Nothing was decided yet. Decisions are saved in ${file}.`),
      make("p", { id: "open-changes" }, open.length ? "Not in the result that is shown; Adjust again takes it up:" : ""),
      make("ul", {}, ...open),
      rows.length ? make("table", { id: "edits" }, make("thead", {}, make("tr", {}, ...heads.map(head => make("th", {}, head)))), make("tbody", {}, ...body)) : "");
  }
}

export class DifferenceSheet {
  constructor(bench) { this.bench = bench; }

  async render(sheet) {
    let found;
    try { found = await ask("data/difference"); } catch (error) { sheet.replaceChildren(make("p", {}, error.message)); return; }
    sheet.replaceChildren(make("p", { id: "verdicts" }, `before: ${found.verdicts[0]} · now: ${found.verdicts[1]}`), ...found.notes.map(note => make("p", {}, note)),
      ...found.tables.map(table => make("table", {}, make("caption", {}, table.title),
        make("thead", {}, make("tr", {}, ...table.columns.map(name => make("th", {}, name)))),
        make("tbody", {}, ...table.rows.map(row => make("tr", {}, ...row.map(text => make("td", {}, text))))))));
  }
}
