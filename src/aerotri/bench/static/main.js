// The bench: what is chosen, and which part of the page shows it.

import { ask } from "./api.js";
import { button, fixed, guarded, say } from "./dom.js";
import { Plan } from "./plan.js";
import { RayTable } from "./table.js";

const LOOK_MS = 1000;

class Bench {
  constructor() {
    this.chosen = { image: null, point: null };
    this.imagesOfPoint = [];
    this.limit = 3.29;
    this.plan = new Plan(this);
    this.tabs = { rays: ["Rays", new RayTable(this)] };
    this.tab = "rays";
  }

  async open() {
    await this.load();
    this.plan.fit();
    this.drawTabs();
    await this.showTab();
    document.body.dataset.ready = "yes";
    this.watch();
  }

  async load() {
    const [summary, plan] = await Promise.all([ask("data/summary"), ask("data/plan")]);
    this.summary = summary;
    this.generation = summary.generation;
    this.limit = summary.limit;
    this.names = { images: plan.images.name, points: plan.points.name };
    this.plan.take(plan);
    this.head();
    this.plan.surface.redraw();
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
    await this.tabs[name][1].render(document.getElementById("sheet"));
  }

  wanted() {}

  stateOfRay() { return ""; }

  async choosePoint(point) {
    this.chosen.point = point;
    const found = await ask(`data/point/${point}`);
    this.imagesOfPoint = found.rays.image;
    this.pointContent = found;
    this.plan.surface.redraw();
    await this.showTab();
  }

  async chooseImage(image) {
    this.chosen.image = image;
    this.plan.surface.redraw();
  }

  async chooseRay(image, point) {
    this.chosen.image = image;
    await this.choosePoint(point);
    await this.chooseImage(image);
  }

  watch() {
    setInterval(guarded(async () => {
      const state = await ask("data/state");
      document.getElementById("work").textContent = state.equations === "being set up" ? "setting up the equations …" : "";
      document.body.dataset.equations = state.equations;
    }), LOOK_MS);
  }
}

const bench = new Bench();
window.bench = bench;
bench.open().catch(error => say(error.message));
