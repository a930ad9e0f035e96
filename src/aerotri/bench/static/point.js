// The chosen point: what is known of it, its photographs as cut-outs, and decisions about it.

import { button, fixed, guarded, make } from "./dom.js";
import { colourOfW } from "./colours.js";
import { cross, ring } from "./marks.js";

const SHOWN = 200, REASONS = ["wrong point", "blurred", "hidden", "target was moved", "measured twice", "as a check"];

export class PointSheet {
  constructor(bench) {
    this.bench = bench;
    this.size = 64;
    this.reason = "";
  }

  render(sheet) {
    const found = this.bench.pointContent;
    if (!found || this.bench.chosen.point === null) {
      sheet.replaceChildren(make("p", {}, "Choose a point in the plan, in a photograph or in the table of rays."));
      return;
    }
    sheet.replaceChildren(this.facts(found), this.decisions(found), this.cutouts(found));
  }

  facts(found) {
    const three = (values, digits) => values.map(value => fixed(value, digits) || "–").join("  ");
    const facts = [["X Y Z", three(found.xyz, 3) + " m"], ["σ", three(found.sigma, 3) + " m"], ["largest |w|", fixed(found.w, 1) || "–"], ["rays", found.rays.ray.length]];
    if (found.given) facts.push([found.given.is_check ? "check point" : "control point", `adjusted − given  ${three(found.given.difference, 3)} m`]);
    return make("div", { class: "tools" }, make("b", { id: "point-name" }, found.name), ...facts.map(([name, value]) => make("span", {}, `${name}: ${value}`)));
  }

  decisions(found) {
    const { image } = this.bench.chosen, measured = image !== null && this.bench.isMeasured(image, found);
    const reason = make("input", { id: "reason", list: "reasons", placeholder: "reason", value: this.reason, oninput: event => { this.reason = event.target.value; } });
    const words = make("datalist", { id: "reasons" }, ...REASONS.map(value => make("option", { value })));
    // the reason goes with one decision; where that fails it stays
    const decide = (text, id, work, title) => {
      const made = button(text, async () => {
        const reason = this.reason;
        this.reason = "";
        try { await work(reason); } catch (error) { this.reason = reason; throw error; }
      }, title);
      made.id = id;
      return made;
    };
    const choose = (whole, action) => reason => this.bench.switch(whole ? null : image, found.name, action, reason);
    const off = whole => this.bench.switchOf(whole ? null : image, found.point) === "off";
    const made = [];
    if (measured) {
      made.push(decide(off(false) ? "ray on" : "ray off", "ray-off", choose(false, off(false) ? "on" : "off"), "The ray in the chosen photograph"));
      made.push(decide("remove mark", "remove-mark", reason => this.bench.removeMark(image, found.name, reason), "The mark in the chosen photograph"));
    }
    made.push(decide(off(true) ? "point on" : "point off", "point-off", choose(true, off(true) ? "on" : "off"), found.given ? "Its given coordinates" : "All its rays"));
    if (found.given) {
      const role = this.bench.switchOf(null, found.point), isCheck = role ? role === "check" : found.given.is_check;
      made.push(decide(isCheck ? "use as control" : "use as check", "role", choose(true, isCheck ? "control" : "check")));
    }
    return make("div", { class: "tools" }, reason, words, ...made);
  }

  cutouts(found) {
    const places = new Map();
    found.expected.forEach(([image, column, row]) => places.set(image, { expected: [column, row] }));
    found.rays.image.forEach((image, k) => {
      const px = found.rays.px[k], v = found.rays.v[k];
      places.set(image, { ...places.get(image), px, size: found.rays.size[k], expected: v[0] === null ? places.get(image)?.expected : [px[0] + v[0], px[1] + v[1]] });
    });
    for (const one of this.bench.changes) {
      if (one.point !== found.point || one.image === null) continue;
      places.set(one.image, { ...places.get(one.image), ...(one.px ? { px: one.px, changed: true } : one.kind === "removed" ? { px: null, changed: true } : {}) });
    }
    const pictures = new Set(this.bench.summary.pictures);
    const larger = by => () => { this.size = Math.min(Math.max(Math.round(this.size * by), 16), 512); this.render(document.querySelector("#sheet .page")); };
    const shown = [...places.entries()].filter(([, place]) => place.px || place.expected);
    return make("div", {}, make("div", { class: "tools" }, button("−", larger(1.5), "more of the photograph"), button("+", larger(1 / 1.5), "less of the photograph"),
      make("span", {}, pictures.size ? `${shown.length} photographs show the point. A click in a cut-out sets the mark there.` : "No photographs: start with --photos DIR to see them.")),
      make("div", { class: "cutouts" }, ...shown.map(([image, place]) => this.cutout(found, image, place, pictures.has(image)))));
  }

  cutout(found, image, place, hasFile) {
    const middle = place.px || place.expected, left = Math.floor(middle[0]) - this.size / 2, top = Math.floor(middle[1]) - this.size / 2;
    const canvas = make("canvas", { width: 2 * SHOWN, height: 2 * SHOWN }), times = 2 * SHOWN / this.size;
    const draw = picture => {
      const pen = canvas.getContext("2d"), at = px => [(px[0] - left) * times, (px[1] - top) * times];
      pen.imageSmoothingEnabled = false;
      pen.filter = this.bench.photo.filter();
      if (picture) pen.drawImage(picture, 0, 0, 2 * SHOWN, 2 * SHOWN);
      pen.filter = "none";
      if (place.expected) ring(pen, ...at(place.expected), 12, "#53d0ff", 2);
      if (place.px) cross(pen, ...at(place.px), 24, place.changed ? "#ffb000" : colourOfW(place.size), 2.5);
    };
    draw(null);
    if (hasFile) {
      const picture = new Image();
      picture.onload = () => draw(picture);
      picture.src = `cutout/${image}?left=${left}&top=${top}&size=${this.size}`;
    }
    canvas.addEventListener("click", guarded(async event => {
      const px = [left + event.offsetX / canvas.clientWidth * this.size, top + event.offsetY / canvas.clientHeight * this.size];
      await this.bench.setMark(image, found.name, px, this.bench.photo.show.snap);
    }));
    const state = place.px ? (place.changed ? "changed" : `|w| ${fixed(place.size, 1) || "–"}`) : place.changed ? "removed" : "not measured";
    const open = button("open", () => this.bench.chooseRay(image, found.point), "Show this photograph");
    return make("figure", { class: image === this.bench.chosen.image ? "chosen" : "" }, canvas,
      make("figcaption", {}, `${this.bench.names.images[image]}: ${state} `, open));
  }
}
