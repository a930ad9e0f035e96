// Points, projection centres and the rays of the chosen point in space: drag turns, the wheel scales.

import { make } from "./dom.js";
import { STEPS, UNKNOWN } from "./colours.js";

export class SpaceSheet {
  constructor(bench) {
    this.bench = bench;
    this.turn = 0.6;
    this.tilt = 0.5;
    this.zoom = 1;
    this.canvas = make("canvas", { id: "space" });
    this.listen();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  render(sheet) {
    sheet.replaceChildren(this.canvas, make("p", { class: "hint" }, "Points in the colours of the plan, projection centres dark, rays of the chosen point blue. Drag turns, the wheel scales. Heights are not exaggerated."));
    this.draw();
  }

  listen() {
    let held = null;
    this.canvas.addEventListener("pointerdown", event => { held = [event.offsetX, event.offsetY]; this.canvas.setPointerCapture(event.pointerId); });
    this.canvas.addEventListener("pointerup", () => { held = null; });
    this.canvas.addEventListener("pointermove", event => {
      if (!held) return;
      this.turn += (event.offsetX - held[0]) * 0.01;
      this.tilt = Math.min(Math.max(this.tilt + (event.offsetY - held[1]) * 0.01, 0), Math.PI / 2);
      held = [event.offsetX, event.offsetY];
      this.draw();
    });
    this.canvas.addEventListener("wheel", event => { event.preventDefault(); this.zoom *= Math.exp(-event.deltaY * 0.0015); this.draw(); }, { passive: false });
  }

  // Points and centres: the least and the largest coordinates.
  bounds() {
    const { points, images } = this.bench.plan.content, low = [Infinity, Infinity, Infinity], high = low.map(value => -value);
    for (const place of [...points.xyz, ...images.centre]) {
      if (place[0] === null || place[2] === null) continue;
      place.forEach((value, k) => { low[k] = Math.min(low[k], value); high[k] = Math.max(high[k], value); });
    }
    return low[0] > high[0] ? [[-1, -1, -1], [1, 1, 1]] : [low, high];
  }

  // The block's middle in the middle of the canvas, seen from far away; whole from every side.
  view(width, height) {
    const [low, high] = this.bounds(), [cx, cy, cz] = low.map((value, k) => (value + high[k]) / 2);
    const scale = this.zoom * 0.95 * Math.min(width, height) / Math.max(Math.hypot(...low.map((value, k) => high[k] - value)), 1e-9);
    const cos = Math.cos(this.turn), sin = Math.sin(this.turn), ct = Math.cos(this.tilt), st = Math.sin(this.tilt);
    return (x, y, z) => {
      const u = (x - cx) * cos - (y - cy) * sin, v = (x - cx) * sin + (y - cy) * cos;
      return [width / 2 + scale * u, height / 2 - scale * (v * st + (z - cz) * ct)];
    };
  }

  draw() {
    const plan = this.bench.plan, canvas = this.canvas, ratio = window.devicePixelRatio || 1;
    if (!plan.content || !canvas.isConnected) return;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d"), at = this.view(width, height), { xyz } = plan.content.points, { centre } = plan.content.images;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    plan.groups.forEach((rows, colour) => {
      pen.fillStyle = colour < STEPS.length ? STEPS[colour] : UNKNOWN;
      for (const k of rows) { const [x, y] = at(xyz[k][0], xyz[k][1], xyz[k][2] ?? 0); pen.fillRect(x - 1, y - 1, 2, 2); }
    });
    pen.fillStyle = "#3b4a5c";
    for (const c of centre) if (c[0] !== null) { const [x, y] = at(...c); pen.fillRect(x - 2, y - 2, 4, 4); }
    this.rays(pen, at, xyz, centre);
    this.axes(pen, height);
  }

  // East, north and up, as long as one another, in the lower left corner.
  axes(pen, height) {
    const cos = Math.cos(this.turn), sin = Math.sin(this.turn), ct = Math.cos(this.tilt), st = Math.sin(this.tilt), x = 60, y = height - 70;
    const ends = { E: [cos, -sin * st], N: [-sin, -cos * st], up: [0, -ct] };
    pen.strokeStyle = pen.fillStyle = "#111";
    pen.lineWidth = 1.5;
    pen.font = "12px system-ui, sans-serif";
    for (const [name, [u, v]] of Object.entries(ends)) {
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 36 * u, y + 36 * v);
      pen.stroke();
      pen.fillText(name, x + 46 * u - 5, y + 46 * v + 4);
    }
  }

  rays(pen, at, xyz, centre) {
    const { point } = this.bench.chosen;
    if (point === null || xyz[point][2] === null) return;
    pen.strokeStyle = "#0b63b8";
    pen.beginPath();
    for (const image of this.bench.imagesOfPoint) {
      if (centre[image][0] === null) continue;
      pen.moveTo(...at(...xyz[point]));
      pen.lineTo(...at(...centre[image]));
    }
    pen.stroke();
    pen.beginPath();
    pen.arc(...at(...xyz[point]), 6, 0, 7);
    pen.stroke();
  }
}
