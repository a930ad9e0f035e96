// Decisions so far, and what the last adjustment changed.

import { ask } from "./api.js";
import { fixed, guarded, make } from "./dom.js";

// What a row of edits.csv says, in words.
const ACTIONS = { mark: "mark set", remove: "mark removed", off: "switched off", on: "switched on", check: "used as check point", control: "used as control point", new_control: "new control point", new_check: "new check point", undo: "taken back" };
const KINDS = { moved: "mark moved", new: "mark set", removed: "mark removed", off: "switched off", on: "switched on", check: "used as check point", control: "used as control point", new_control: "new control point", new_check: "new check point" };

export class EditSheet {
  constructor(bench) { this.bench = bench; }

  render(sheet) {
    const { rows, file, changes } = this.bench.edits;
    const pair = place => place ? `${fixed(place[0], 2)}, ${fixed(place[1], 2)}` : "";
    const body = rows.map(one => make("tr", { class: one.stands ? "" : "off" },
      ...[one.time.replace("T", " ").slice(0, 19), ACTIONS[one.action] ?? one.action, one.image, one.point, pair(one.place), pair(one.before), one.reason].map(text => make("td", {}, text))));
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

export class NextSheet {
  constructor(bench) { this.bench = bench; }

  async render(sheet) {
    sheet.replaceChildren(make("p", {}, "Computing which measurement helps most …"));
    let found;
    try { found = await ask("data/next"); } catch (error) { sheet.replaceChildren(make("p", {}, error.message)); return; }
    if (!found.marks.length) { sheet.replaceChildren(make("p", {}, "Every control point is measured wherever it can be seen, and no weak point is seen by more photographs.")); return; }
    const names = this.bench.names, heads = ["point", "photograph", "σ of all points, mm", "with this mark, mm", "less by"];
    const rows = found.marks.map(one => {
      const cells = [names.points[one.point] + (one.is_control ? " (control)" : ""), names.images[one.image], (1000 * one.before).toFixed(3), (1000 * one.after).toFixed(3), `${(100 * (1 - one.after / one.before)).toFixed(2)} %`];
      const go = guarded(async () => { await this.bench.chooseRay(one.image, one.point); this.bench.photo.look(one.place); });
      return make("tr", { tabIndex: 0, onclick: go, onkeydown: event => { if (event.key === "Enter") go(); } },
        ...cells.map((text, k) => make("td", { class: k > 1 ? "n" : "" }, text)));
    });
    sheet.replaceChildren(make("p", {}, "The measurement that lowers the root mean square σ of all points most stands first. Click one, then Set mark."),
      make("table", { id: "next" }, make("thead", {}, make("tr", {}, ...heads.map((head, k) => make("th", { class: k > 1 ? "n" : "" }, head)))), make("tbody", {}, ...rows)));
  }
}
