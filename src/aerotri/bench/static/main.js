// The bench: what is chosen, what was decided, and which part of the page shows it.

import { ask, tell } from "./api.js";
import { button, fieldHeld, fixed, guarded, make, say } from "./dom.js";
import { Photo } from "./photo.js";
import { Plan } from "./plan.js";
import { PointSheet } from "./point.js";
import { SpaceSheet } from "./space.js";
import { NewPointSheet } from "./new_point.js";
import { DifferenceSheet, EditSheet, NextSheet } from "./sheets.js";
import { RayTable } from "./table.js";

const LOOK_MS = 1000;

class Bench {
  constructor() {
    this.chosen = { image: null, point: null };
    this.newPoint = null;
    this.imagesOfPoint = [];
    this.changes = [];
    this.limit = 3.29;
    this.plan = new Plan(this);
    this.photo = new Photo(this);
    this.tabs = {
      rays: ["Rays", new RayTable(this)], point: ["Point", new PointSheet(this)], fresh: ["New point", new NewPointSheet(this)], edits: ["Decisions", new EditSheet(this)],
      difference: ["Difference", new DifferenceSheet(this)], next: ["Which mark next", new NextSheet(this)], space: ["3-D", new SpaceSheet(this)],
    };
    this.tab = "rays";
  }

  async open() {
    await this.load();
    this.plan.takeLayers((await ask("data/layers")).layers);
    this.plan.fit();
    await this.showTab();
    document.body.dataset.ready = "yes";
    document.addEventListener("keydown", event => this.key(event));
    this.watch();
  }

  async load() {
    const [summary, plan, edits] = await Promise.all([ask("data/summary"), ask("data/plan"), ask("data/edits")]);
    const names = this.names;
    this.summary = summary;
    this.generation = summary.generation;
    this.limit = summary.limit;
    this.names = { images: plan.images.name, points: plan.points.name };
    this.keepChosen(names);
    this.plan.ellipses = null;
    this.plan.take(plan);
    this.takeEdits(edits);
    this.head();
    this.photo.bar();
    this.plan.surface.redraw();
  }

  // Rows may stand elsewhere in another result: what is chosen is known by its name.
  keepChosen(before) {
    if (!before) return;
    for (const [what, list] of [["image", "images"], ["point", "points"]]) {
      if (this.chosen[what] === null) continue;
      const row = this.names[list].indexOf(before[list][this.chosen[what]]);
      this.chosen[what] = row < 0 ? null : row;
    }
  }

  takeEdits(edits) {
    this.edits = edits;
    this.changes = edits.changes;
    document.body.dataset.changes = edits.changes.length;
    this.actions();
  }

  head() {
    const s = this.summary, verdict = document.getElementById("verdict");
    document.title = `${s.name} – aerotri bench`;
    document.getElementById("name").textContent = s.name;
    verdict.textContent = s.verdict || s.status;
    verdict.className = s.verdict;
    verdict.title = s.reasons.join("\n");
    const counts = Object.entries(s.counts).filter(([, count]) => count).slice(0, 3).map(([what, count]) => `${count} ${what}`).join(", ");
    document.getElementById("outcome").textContent =
      (s.sigma0 ? `σ0 ${fixed(s.sigma0, 3)} (${fixed(s.sigma0_um, 2)} µm), ` : "") + counts + (s.result ? ` · ${s.result}` : "");
    document.body.dataset.generation = this.generation;
  }

  actions() {
    const undo = button("Undo", () => this.undo(), "Take the last decision back (Ctrl-Z)"), running = this.job && this.job.running;
    undo.id = "undo";
    undo.disabled = !this.edits.can_undo;
    const adjust = running ? button("Stop", () => tell("act/stop")) : button(this.summary.sigma0 ? "Adjust again" : "Adjust", () => this.adjust(), "In the background; then see Difference");
    adjust.id = "adjust";
    document.getElementById("actions").replaceChildren(undo, adjust, ...(this.more || []));
  }

  drawTabs() {
    document.getElementById("tabs").replaceChildren(...Object.entries(this.tabs).map(([name, [words]]) => {
      const tab = button(words, () => this.showTab(name));
      tab.id = `tab-${name}`;
      tab.setAttribute("aria-selected", name === this.tab);
      return tab;
    }));
  }

  async showTab(name = this.tab) {
    this.tab = name;
    this.drawTabs();
    // a page of its own: an answer that comes late must not write over another tab
    const page = make("div", { class: "page" }), sheet = document.getElementById("sheet"), giveBack = fieldHeld(sheet);
    sheet.replaceChildren(page);
    const drawn = this.tabs[name][1].render(page);
    giveBack();
    await drawn;
  }

  async wanted(layer) {
    if (layer === "ellipses" && !this.plan.ellipses && !this.waiting) {
      await guarded(async () => { this.plan.ellipses = await ask("data/ellipses"); })();
      this.plan.surface.redraw();
    }
  }

  // What was decided about a ray since the result, in words.
  stateOfRay(image, point) {
    const found = this.changes.filter(one => one.point === point && (one.image === image || one.image === null)).map(one => one.kind);
    if (found.includes("removed")) return "removed";
    if (found.includes("off")) return "switched off";
    return found.includes("moved") ? "moved" : found.includes("on") ? "switched on" : "";
  }

  switchOf(image, point) {
    const name = image === null ? "" : this.names.images[image];
    const last = this.edits.rows.find(one => one.stands && one.image === name && one.point === this.names.points[point] && ["off", "on", "check", "control"].includes(one.action));
    return last && last.action !== "on" ? last.action : "";
  }

  isMeasured(image, found) {
    const changed = this.changes.find(one => one.image === image && one.point === found.point && ["moved", "new", "removed"].includes(one.kind));
    return changed ? changed.kind !== "removed" : found.rays.image.includes(image);
  }

  // What a mark is set for: the new point that is being made, or the chosen one.
  nameToMark() {
    return this.newPoint ?? (this.chosen.point === null ? null : this.names.points[this.chosen.point]);
  }

  async choosePoint(point) {
    this.newPoint = null;
    this.chosen.point = point;
    await this.loadPoint();
    const shown = [...this.imagesOfPoint, ...(this.pointContent?.expected || []).map(one => one[0])];
    if (this.chosen.image === null && shown.length) { await this.chooseRay(shown[0], point); return; }
    await this.photo.epipolar();
    this.photo.bar();
    await this.showTab();
  }

  async loadPoint() {
    const { point } = this.chosen;
    this.pointContent = point === null ? null : await ask(`data/point/${point}`);
    this.imagesOfPoint = point === null ? [] : this.pointContent.rays.image;
    this.plan.surface.redraw();
  }

  async chooseImage(image) {
    this.chosen.image = image;
    this.plan.surface.redraw();
    await this.photo.open(image);
    if (this.tab === "point") await this.showTab();
  }

  async chooseRay(image, point) {
    this.newPoint = null;
    this.chosen = { image, point };
    await this.loadPoint();
    await this.photo.open(image, point);
    this.photo.bar();
    await this.showTab();
    document.body.dataset.shown = `${this.names.images[image]} ${this.names.points[point]}`;
  }

  async setMark(image, point, at, snap) {
    const found = await tell("act/mark", { image, point, column: at[0], row: at[1], snap });
    const other = found.read !== null && found.named && found.named !== point;
    if (other) say(`The target reads ${found.read}: that is point ${found.named}, not ${point}. Undo takes the mark back.`);
    this.note(snap ? (found.snapped ? `Mark of ${point}: ${found.snapped}` : `Mark of ${point}: where you clicked, no target and no match there`) : "");
    await this.decided(found);
  }

  note(text) { document.getElementById("photo-hint").textContent = text; }

  async removeMark(image, point, reason) { await this.decided(await tell("act/remove", { image, point, reason })); }

  async switch(image, point, action, reason) { await this.decided(await tell("act/switch", { image, point, action, reason })); }

  async undo() { await this.decided(await tell("act/undo")); }

  async decided(edits) {
    this.takeEdits(edits);
    this.photo.surface.redraw();
    await this.showTab();
  }

  async adjust() {
    await tell("act/adjust");
    await this.lookAtJob();
  }

  async lookAtJob() {
    const state = await ask("data/state"), job = state.job, was = this.job;
    this.job = job;
    document.body.dataset.equations = state.equations;
    document.body.dataset.job = job ? (job.running ? "running" : job.error ? "failed" : "done") : "";
    const percent = job && job.share !== null ? ` ${Math.round(100 * job.share)} %` : "";
    document.getElementById("work").textContent = job && job.running ? `adjusting: ${job.stage}${percent}, ${Math.round(job.seconds)} s`
      : state.equations === "being set up" ? "setting up the equations …" : "";
    if (Boolean(was && was.running) !== Boolean(job && job.running)) this.actions();
    if (was && was.running && job && !job.running && job.error) say(job.error);
    if (state.generation !== this.generation) await this.renew();
    if (this.waiting && state.equations !== "being set up") { this.waiting = false; await this.loadPoint(); await this.showTab(); if (this.chosen.image !== null) await this.reopen(); }
    if (state.equations === "being set up") this.waiting = true;
    // equations may be ready before anybody saw them being set up
    if (state.equations === "ready" && this.plan.show.ellipses) await this.wanted("ellipses");
  }

  // Another result is there: everything is asked for again, what is looked at stays.
  async renew() {
    const first = !this.summary.sigma0;
    await this.load();
    if (first) this.plan.fit();
    await this.loadPoint();
    if (this.chosen.image !== null) await this.reopen();
    await this.showTab(this.summary.compared ? "difference" : this.tab);
  }

  async reopen() {
    this.photo.generation = -1;
    await this.photo.open(this.chosen.image);
  }

  key(event) {
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") { event.preventDefault(); guarded(() => this.undo())(); }
    else if (event.key === "m" && this.nameToMark() !== null && this.photo.content) this.photo.beginSetting();
  }

  watch() {
    const look = async () => {
      try { await this.lookAtJob(); } catch (error) { document.getElementById("work").textContent = "the bench has ended"; }
      setTimeout(look, LOOK_MS);
    };
    look();
  }
}

const bench = new Bench();
window.bench = bench;
bench.open().catch(error => say(error.message));
