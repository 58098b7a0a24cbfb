// One page of one run: whatever is clicked, the robot is posed there, and everything else follows.

import { CellView, contactFrame, matrix } from "./cell";
import { type Cell, ContactChart, scaleColour } from "./chart";
import { after, Curves } from "./curves";
import { Block, degrees, element, type Mark, type Page } from "./data";

interface Shown {
  q: ArrayLike<number> | null; // null where the arm does not reach
  time: number | null;
  point: number | null;
  t: number | null;
  hit: string[];
  text: string;
}

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20];

class Viewer {
  readonly view: CellView | null;
  readonly chart: ContactChart | null;
  shown: Shown | null = null;
  private curves: Curves | null = null;
  private readonly motion: Record<"q" | "time" | "t" | "point" | "pass" | "kind", ArrayLike<number>> | null;
  private readonly near: Record<"time" | "distance" | "pair" | "points", ArrayLike<number>> | null;
  private time = 0;
  private playing = 0; // when the last picture was made; 0 at rest

  constructor(private readonly page: Page, private readonly block: Block) {
    const { motion, clearance: near } = page;
    const unpack = (packed: Page["points"] & object) => Object.fromEntries(Object.entries(packed).filter(([, value]) => !Array.isArray(value)).map(([name, value]) => [name, block.array(value)]));
    this.motion = motion && (unpack(motion as never) as never);
    this.near = near && (unpack(near as never) as never);
    this.view = this.open();
    this.chart = page.field === null ? null : new ContactChart(page, block, (cell) => this.showCell(cell), tell);
    if (this.motion !== null) this.connectPlayer();
    this.connectControls();
    for (const [id, mark] of Object.entries(page.marks)) {
      for (const row of document.querySelectorAll(`[data-mark="${id}"]`)) row.addEventListener("click", () => this.showMark(mark));
    }
    if (page.marks.start !== undefined) this.showMark(page.marks.start);
    else if (this.motion !== null) this.showTime(0);
    else if (page.home !== null) this.show({ q: page.home, time: null, point: null, t: null, hit: [], text: "home" });
  }

  get end(): number {
    return this.motion === null ? 0 : this.motion.time[this.motion.time.length - 1];
  }

  show(shown: Shown): void {
    const { page, view } = this;
    this.shown = shown;
    this.chart?.cursor(shown.point, shown.t);
    this.curves?.cursor(shown.time);
    write("posture", shown.text);
    write("angles", page.joints.map((joint, k) => (shown.q === null ? "" : `${joint.name} ${degrees(shown.q[k]).toFixed(2)}`)).join("  "));
    if (view === null) return;
    if (shown.q !== null) view.pose(shown.q);
    view.contact(shown.t);
    view.phantom(shown.q === null ? this.partAt(shown) : null);
    view.mark(shown.hit);
    if (shown.time === null) view.line(null);
    if (element<HTMLInputElement>("section").checked) view.show("section", true);
  }

  showTime(time: number): void {
    const { motion, page } = this;
    if (motion === null) return;
    this.time = Math.max(0, Math.min(time, this.end));
    const move = Math.max(1, after(motion.time, this.time));
    const length = motion.time[move] - motion.time[move - 1];
    const part = length > 0 ? (this.time - motion.time[move - 1]) / length : 1;
    const at = (values: ArrayLike<number>, width = 1, k = 0) => {
      const [from, to] = [values[width * (move - 1) + k], values[width * move + k]];
      return part === 1 ? to : from + part * (to - from); // NaN unless both ends are on the wheel
    };
    const [point, t] = [at(motion.point), at(motion.t)];
    const onWheel = !Number.isNaN(point) && (part === 1 || motion.pass[move] === motion.pass[move - 1]);
    element<HTMLInputElement>("time").value = String(this.time);
    write("clock", `${this.time.toFixed(2)} s`);
    const pass = motion.pass[move] < 0 ? "" : `, pass ${motion.pass[move] + 1}`;
    let text = `${this.time.toFixed(2)} s, ${page.motion?.kinds[motion.kind[move]]}${pass}`;
    if (onWheel) text += `, cutter point ${point.toFixed(2)}, t ${t.toFixed(2)}`;
    text += this.nearest();
    const q = Array.from({ length: 6 }, (_, k) => at(motion.q, 6, k));
    this.show({ q, time: this.time, point: onWheel ? point : null, t: onWheel ? t : null, hit: [], text });
    let last = move - 1;
    while (last > 0 && Number.isNaN(motion.point[last])) last--;
    this.view?.ground(onWheel ? point : motion.point[last]);
  }

  // The clearance at the moment of its measure nearest to this one, and its line in the view.
  private nearest(): string {
    const { near, page } = this;
    if (near === null || near.time.length === 0) return "";
    let k = after(near.time, this.time);
    if (k > 0 && this.time - near.time[k - 1] < near.time[k] - this.time) k--;
    const drawn = element<HTMLInputElement>("line").checked;
    this.view?.line(drawn ? Array.from({ length: 6 }, (_, c) => near.points[6 * k + c]) : null);
    return `, nearest: ${page.clearance?.pairs[near.pair[k]]?.join(" and ")} ${(1e3 * near.distance[k]).toFixed(1)} mm`;
  }

  private showCell(cell: Cell): void {
    this.stop();
    const missing = cell.q === null ? "; the part is shown where it would have to be, the arm does not reach" : "";
    this.show({ q: cell.q, time: null, point: cell.point, t: cell.t, hit: cell.hit, text: cell.text + missing });
  }

  private showMark(mark: Mark): void {
    this.stop();
    const { motion, chart } = this;
    if (mark.move !== undefined && motion !== null) this.showTime(motion.time[mark.move]);
    else if (mark.q !== undefined) this.show({ time: null, point: null, t: null, hit: [], ...mark, q: mark.q });
    else if (mark.point !== undefined) chart?.choose(chart.nearestTo(mark.point, mark.t ?? 0));
    if (mark.hit !== undefined) this.view?.mark(mark.hit);
  }

  private partAt({ point, t }: Shown) {
    const { wheel, points } = this.page;
    if (point === null || t === null || wheel === null || points === null) return null;
    const T_workpiece_cutter = matrix(this.block.array(points.frames).slice(12 * point, 12 * point + 12));
    return contactFrame(wheel, t).multiply(T_workpiece_cutter.invert());
  }

  private open(): CellView | null {
    const canvas = element<HTMLCanvasElement>("view");
    try {
      return new CellView(canvas, this.page, this.block);
    } catch (error) {
      canvas.replaceWith(`This browser shows no WebGL, so the cell is not drawn (${error}). Everything else works.`);
      return null;
    }
  }

  private connectPlayer(): void {
    const scrubber = element<HTMLInputElement>("time");
    scrubber.max = String(this.end);
    scrubber.addEventListener("input", () => this.goTo(Number(scrubber.value)));
    const turn = () => (this.playing ? this.stop() : this.play());
    element<HTMLElement>("play").addEventListener("click", turn);
    document.addEventListener("keydown", (event) => {
      if (event.key !== " " || event.target !== document.body) return;
      event.preventDefault();
      turn();
    });
    const choice = element<HTMLSelectElement>("curves-of");
    const draw = () => {
      const panels = this.page.curves[choice.value];
      this.curves = new Curves(element<HTMLElement>("curves"), panels, this.end, this.block, (time) => this.goTo(time), tell);
      this.curves.cursor(this.shown?.time ?? null);
    };
    choice.addEventListener("change", draw);
    draw();
  }

  private goTo(time: number): void {
    this.stop();
    this.showTime(time);
  }

  private play(): void {
    if (this.time >= this.end) this.time = 0;
    write("play", "pause");
    this.playing = performance.now();
    const step = (now: number) => {
      if (!this.playing) return;
      const next = this.time + (Math.max(0, now - this.playing) / 1000) * SPEEDS[Number(element<HTMLInputElement>("speed").value)];
      this.playing = now;
      this.showTime(next);
      if (next < this.end) requestAnimationFrame(step);
      else this.stop();
    };
    requestAnimationFrame(step);
  }

  private stop(): void {
    this.playing = 0;
    write("play", "play");
  }

  private connectControls(): void {
    const speed = element<HTMLInputElement>("speed");
    const told = () => write("speed-text", `${SPEEDS[Number(speed.value)]} x`);
    speed.addEventListener("input", told);
    told();
    const look = element<HTMLSelectElement>("look");
    look.addEventListener("change", () => this.view?.look(look.value));
    for (const what of ["section", "frames", "surroundings"] as const) {
      const box = element<HTMLInputElement>(what);
      box.addEventListener("change", () => this.view?.show(what, box.checked));
    }
    element<HTMLInputElement>("line").addEventListener("change", () => this.shown?.time != null && this.showTime(this.time));
    const paint = element<HTMLSelectElement>("paint");
    paint.addEventListener("change", () => this.paintPasses(paint.value));
    this.paintPasses(paint.value);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.view?.recolour();
      this.chart?.drawCells();
    });
  }

  // Colours along the passes in the view, with a scale beside it.
  private paintPasses(what: string): void {
    const paint = this.page.paints[what];
    element<HTMLElement>("scale").hidden = paint === undefined;
    if (paint === undefined) return this.view?.colourPasses(null);
    const values = this.block.array(paint.values);
    let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
    for (const value of values) if (!Number.isNaN(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
    const colours = new Float32Array(3 * values.length).fill(0.5);
    values.forEach((value: number, k: number) => !Number.isNaN(value) && colours.set(scaleColour((value - low) / (high - low || 1)), 3 * k));
    write("scale-low", low > high ? "" : low.toFixed(2));
    write("scale-high", low > high ? "not known" : `${high.toFixed(2)} ${paint.unit}`);
    return this.view?.colourPasses(colours);
  }
}

const write = (id: string, text: string) => {
  element<HTMLElement>(id).textContent = text;
};
const tell = (text: string) => write("hover", text);

async function start(): Promise<void> {
  const page: Page = JSON.parse(element<HTMLElement>("page-data").textContent ?? "");
  const block = await Block.inflate((element<HTMLElement>("page-block").textContent ?? "").trim());
  Object.assign(window, { opl: new Viewer(page, block) }); // for whoever asks at the console, as tests do
}

start().catch((error) => {
  write("posture", `This page could not be opened: ${error}`);
  throw error;
});
