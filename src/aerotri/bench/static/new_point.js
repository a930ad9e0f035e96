// A new point: a tie point by its marks alone, a control or check point by coordinates too.

import { tell } from "./api.js";
import { button, choice, fixed, make } from "./dom.js";

const KINDS = { tie: "tie point", new_control: "control point", new_check: "check point" };
const FIELDS = ["X", "Y", "Z", "σ X", "σ Y", "σ Z"];

export class NewPointSheet {
  constructor(bench) {
    this.bench = bench;
    this.kind = "tie";
    this.name = "";
    this.values = ["", "", "", "", "", ""];
  }

  render(sheet) {
    const name = make("input", { id: "new-name", placeholder: "name", value: this.name, oninput: event => { this.name = event.target.value; } });
    const kind = choice("kind", KINDS, this.kind, value => { this.kind = value; this.render(sheet); });
    const fields = this.kind === "tie" ? [] : FIELDS.map((words, k) => make("label", {}, `${words}, m `,
      make("input", { class: "metres", id: `new-${k}`, value: this.values[k], oninput: event => { this.values[k] = event.target.value; } })));
    const begin = button(this.kind === "tie" ? "Begin marking" : "Add and begin marking", () => this.begin(sheet));
    begin.id = "new-begin";
    sheet.replaceChildren(make("div", { class: "tools" }, name, kind, ...fields, begin), this.marks());
  }

  async begin(sheet) {
    const name = this.name.trim();
    if (!name) throw new Error("a point needs a name — give it one");
    if (this.kind === "tie" && this.bench.names.points.includes(name)) throw new Error(`'${name}' is a point already — give the new point another name`);
    if (this.kind !== "tie") {
      const given = this.values.map(text => text.trim() === "" ? null : Number(text));
      if (given.some(value => value === null || Number.isNaN(value))) throw new Error("a coordinate or a σ is not a number — fill in all six, with a point such as 0.02");
      this.bench.takeEdits(await tell("act/give", { point: name, action: this.kind, given }));
    }
    this.bench.newPoint = name;
    this.bench.photo.bar();
    this.render(sheet);
  }

  marks() {
    const name = this.bench.newPoint;
    if (name === null) return make("p", {}, "Give the point a name and begin. Then mark it in two or more photographs.");
    const own = this.bench.changes.filter(one => one.name === name && one.px);
    const rows = own.map(one => make("tr", {}, make("td", {}, this.bench.names.images[one.image]), make("td", { class: "n" }, fixed(one.px[0], 2)), make("td", { class: "n" }, fixed(one.px[1], 2)),
      make("td", {}, one.reason), make("td", {}, button("remove", () => this.bench.removeMark(one.image, name, "")))));
    const next = own.length < 2 ? `${2 - own.length} more needed at least: choose a photograph, press Set mark, click on the point.` : "Adjust again takes the point up; more marks make it more certain.";
    return make("div", {}, make("p", { id: "new-marks" }, `${name}: ${own.length} marks. ${next}`),
      own.length ? make("table", {}, make("thead", {}, make("tr", {}, ...["photograph", "column", "row", "how", ""].map(head => make("th", {}, head)))), make("tbody", {}, ...rows)) : "");
  }
}
