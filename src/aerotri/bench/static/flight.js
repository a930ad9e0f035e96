// The bench of a planned flight: map of sigma with strips and control, and what is asked for, to be planned again.

import { ask, tell } from "./api.js";
import { button, choice, fixed, guarded, make, say } from "./dom.js";
import { FlightMap } from "./flight_map.js";

const LOOK_MS = 1000;
const FIELDS = [
  ["gsd", "GSD, m"], ["forward_overlap", "forward overlap, 0 to 0.95"], ["side_overlap", "side overlap, 0 to 0.95"],
  ["direction", "direction of strips, degrees", "along the longest side"], ["cross_strips", "cross strips"], ["height_mode", "altitude: constant or follow"],
  ["rays", "photographs of every place"], ["target", "target", "sigma-z 0.03"], ["control", "control points to add", "auto"],
  ["control_sigma", "σ of control: plan, height, m"], ["positions_sigma", "σ of positions: plan, height, m", "no positions"],
  ["image_sigma", "σ of an image coordinate, px"], ["self_calibration", "additional parameters"],
];

class FlightBench {
  constructor() { this.map = new FlightMap(this); }

  async open() {
    await this.load();
    this.map.fit();
    document.body.dataset.ready = "yes";
    this.watch();
  }

  async load() {
    [this.summary, this.content] = await Promise.all([ask("data/summary"), ask("data/content")]);
    this.generation = this.summary.generation;
    this.map.take(this.content);
    this.head();
    this.fields();
    this.tables();
    document.body.dataset.generation = this.generation;
  }

  head() {
    const s = this.summary, verdict = document.getElementById("verdict"), t = s.target;
    document.title = `${s.name} – aerotri plan`;
    document.getElementById("name").textContent = `Plan of ${s.name}`;
    verdict.textContent = t ? `target ${t.kind} ${t.value} ${t.unit} ${t.met ? "met" : "NOT met"} (${t.predicted.toPrecision(3)} ${t.unit})` : "no target";
    verdict.className = t ? (t.met ? "accepted" : "rejected") : "";
    document.getElementById("outcome").textContent = `camera ${s.camera}, ${s.crs}`;
    this.actions();
  }

  actions() {
    const s = this.summary, running = this.job && this.job.running;
    const plans = choice("plan", Object.fromEntries(s.plans.map(name => [name, name])), s.shown, guarded(name => this.choose(name)));
    const again = running ? button("Stop", () => tell("act/stop")) : button("Plan again", () => this.again(), "With the values of the fields; the plan that is shown stays");
    again.id = "again";
    again.disabled = !s.can_plan;
    document.getElementById("actions").replaceChildren(plans, again);
  }

  // Made once. What was typed since a plan was asked for stays when that plan comes.
  fields() {
    const form = document.getElementById("fields"), { fields } = this.summary;
    if (!form.children.length) {
      form.replaceChildren(...FIELDS.map(([name, words, placeholder]) => make("label", {}, make("span", {}, words),
        make("input", { name, id: `field-${name}`, placeholder: placeholder || "" }))));
      form.onsubmit = event => { event.preventDefault(); guarded(() => this.again())(); };
    }
    for (const [name] of FIELDS) {
      const input = document.getElementById(`field-${name}`);
      if (!this.asked || input.value === this.asked[name]) input.value = fields[name] ?? "";
    }
    this.asked = null;
    form.hidden = !this.summary.can_plan;
  }

  tables() {
    const s = this.summary, cell = (row, name) => row[name] === null ? "" : fixed(row[name], row.digits);
    const heads = ["", ...(s.before ? [s.before] : []), s.shown, ""];
    const rows = s.numbers.map(row => [row.what, ...(s.before ? [cell(row, "before")] : []), cell(row, "now"), row.unit]);
    const parts = [table("numbers", "The plan", heads, rows, k => k > 0 && k < heads.length - 1)];
    const unit = s.target && s.target.unit === "m³" ? "m³" : "cm", factor = unit === "cm" ? 100 : 1;
    const of = value => value === null ? "" : fixed(factor * value, 2);
    if (this.content.control.length) {
      const control = this.content.control.map(one => [one.order || "given", one.point, fixed(one.X, 2), fixed(one.Y, 2), fixed(one.Z, 2), of(one.before), of(one.after)]);
      const made = table("control", "Control, in the order of its gain", ["order", "point", "X, m", "Y, m", "Z, m", `without it, ${unit}`, `with it, ${unit}`], control, k => k > 1);
      made.querySelectorAll("tbody tr").forEach((row, k) => { row.tabIndex = 0; row.onclick = () => this.map.choose(k); });
      parts.push(made);
    }
    if (s.piles.length) parts.push(table("piles", "Piles", ["pile", "size, m²", "σ of the volume, m³"], s.piles.map(one => [one.name, fixed(one.area_m2, 0), one.sigma_m3.toPrecision(3)]), k => k > 0));
    const notes = s.warnings.map(text => make("p", { class: "doubtful" }, text));
    document.getElementById("flight-tables").replaceChildren(...notes, ...parts,
      make("p", { id: "folder" }, `Page, GeoPackage, KML, waypoints and the map of σ are in ${s.folder}.`));
  }

  async again() {
    const fields = Object.fromEntries([...document.querySelectorAll("#fields input")].map(input => [input.name, input.value]));
    this.asked = fields;
    await tell("act/again", { fields });
    await this.look();
  }

  async choose(plan) {
    await tell("act/choose", { plan });
    this.asked = null;
    await this.look();
  }

  async look() {
    const state = await ask("data/state"), job = state.job, was = this.job;
    this.job = job;
    document.body.dataset.job = job ? (job.running ? "running" : job.error ? "failed" : "done") : "";
    document.getElementById("work").textContent = job && job.running ? `planning: ${job.stage}, ${Math.round(job.seconds)} s` : "";
    if (Boolean(was && was.running) !== Boolean(job && job.running)) this.actions();
    if (job && !job.running && job.error && this.told !== job.error) { this.told = job.error; say(job.error); }
    if (job && job.running) this.told = "";
    if (state.generation !== this.generation) await this.load();
  }

  watch() {
    const look = async () => {
      try { await this.look(); } catch (error) { document.getElementById("work").textContent = "the bench has ended"; }
      setTimeout(look, LOOK_MS);
    };
    look();
  }
}

function table(id, caption, heads, rows, isNumber) {
  const cells = (tag, row) => row.map((text, k) => make(tag, { class: isNumber(k) ? "n" : "" }, String(text)));
  return make("table", { id }, make("caption", {}, caption), make("thead", {}, make("tr", {}, ...cells("th", heads))),
    make("tbody", {}, ...rows.map(row => make("tr", {}, ...cells("td", row)))));
}

const bench = new FlightBench();
window.bench = bench;
bench.open().catch(error => say(error.message));
