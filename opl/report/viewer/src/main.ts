// One page of one run: whatever is clicked, the robot is posed there, and everything else follows.

import { CellView, contactFrame, matrix } from "./cell";
import { type Cell, ContactChart } from "./chart";
import { after, Curves } from "./curves";
import { Block, degrees, element, type Mark, type Page, type Unpacking } from "./data";

// without q where the arm does not reach
type Shown = { q: ArrayLike<number> | null; time: number | null; point: number | null; t: number | null; hit: string[]; text: string };

const ROW = 18; // px of a line of a program, as its style has it
const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20];

class Viewer {
  readonly view: CellView | null;
  readonly chart: ContactChart | null;
  shown: Shown | null = null;
  private curves: Curves | null = null;
  private readonly motion: Unpacking<NonNullable<Page["motion"]>> | null;
  private readonly near: Unpacking<NonNullable<Page["clearance"]>> | null;
  private readonly lines = new Map<number, { row: HTMLElement; at: number }>(); // of the program, by the move they end
  private now: { row: HTMLElement; at: number } | undefined;
  private readonly end: number;
  private time = 0;
  private playing = 0; // when the last picture was made; 0 at rest

  constructor(private readonly page: Page, private readonly block: Block) {
    const { motion, clearance: near } = page;
    this.motion = motion && block.all(motion);
    this.near = near && block.all(near);
    this.end = this.motion?.time.at(-1) ?? 0;
    this.view = this.open();
    this.chart = page.field === null ? null : new ContactChart(page, block, (cell) => this.showCell(cell), hover);
    if (this.motion !== null) this.connectPlayer();
    this.connectControls();
    this.listProgram();
    for (const row of document.querySelectorAll<HTMLElement>("[data-mark]")) row.addEventListener("click", () => this.showAndScroll(() => this.showMark(page.marks[row.dataset.mark ?? ""])));
    if (page.marks.start !== undefined) this.showMark(page.marks.start);
    else if (this.motion !== null) this.showTime(0);
    else if (page.home !== null) this.show({ q: page.home, time: null, point: null, t: null, hit: [], text: "home" });
  }

  show(shown: Shown): void {
    const { page, view } = this;
    this.shown = shown;
    if (shown.time === null) this.stop();
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

  showTime(time: number, playing = false): void {
    const { motion, page } = this;
    if (motion === null) return;
    if (!playing) this.stop();
    this.time = Math.fround(Math.max(0, Math.min(time, this.end))); // in as many digits as the times of the motion
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
    this.markLine(move);
  }

  private listProgram(): void {
    const { page, block, motion, page: { program } } = this;
    if (program === null || motion === null) return;
    const lines = block.array(program.lines);
    program.texts.forEach((packed, file) => {
      const rows = block.text(packed).split(/\r?\n/).map((text) => Object.assign(document.createElement("span"), { textContent: `${text}\n` }));
      for (let k = 0; k < lines.length; k += 3) {
        const [at, move] = [lines[k + 1] - 1, lines[k + 2]];
        const row = rows[at];
        if (lines[k] !== file || row === undefined) continue;
        row.className = "move";
        row.dataset.at = Number.isNaN(motion.point[move]) ? page.motion?.kinds[motion.kind[move]] : `${motion.pass[move] + 1}: ${motion.point[move].toFixed(2)}`;
        row.addEventListener("click", () => this.showAndScroll(() => this.showTime(motion.time[move])));
        this.lines.set(move, { row, at });
      }
      const home = element(`program-${file}`);
      home.replaceChildren(...rows);
      home.addEventListener("keydown", (event) => {
        const moves = [...home.querySelectorAll<HTMLElement>(".move")];
        const [now, step] = [moves.findIndex((row) => row === this.now?.row), { ArrowDown: 1, ArrowUp: -1 }[event.key] ?? 0];
        if (step === 0) return;
        event.preventDefault();
        moves[now + step]?.click();
      });
    });
  }

  // Show what was chosen elsewhere on the page, with the view in sight.
  private showAndScroll(show: () => void): void {
    show();
    element("cell").scrollIntoView({ block: "nearest" });
  }

  // The line of the program that is being played, marked and in sight.
  private markLine(move: number): void {
    while (move < (this.motion?.time.length ?? 0) && !this.lines.has(move)) move++; // a line may lead over several moves
    const line = this.lines.get(move);
    if (line === this.now) return;
    this.now?.row.classList.remove("now");
    this.now = line;
    line?.row.classList.add("now");
    line?.row.parentElement?.scrollTo(0, ROW * (line.at - 5));
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
    const missing = cell.q === null ? "; the part is shown where it would have to be, the arm does not reach" : "";
    this.show({ q: cell.q, time: null, point: cell.point, t: cell.t, hit: cell.hit, text: cell.text + missing });
  }

  private showMark(mark: Mark): void {
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
    scrubber.addEventListener("input", () => this.showTime(Number(scrubber.value)));
    element("play").addEventListener("click", () => (this.playing ? this.stop() : this.play()));
    const choice = element<HTMLSelectElement>("curves-of");
    const draw = () => {
      const panels = this.page.curves[choice.value];
      this.curves = new Curves(element("curves"), panels, this.end, this.block, (time) => this.showTime(time), hover);
      this.curves.cursor(this.shown?.time ?? null);
    };
    choice.addEventListener("change", draw);
    draw();
  }

  private play(): void {
    if (this.time >= this.end) this.time = 0;
    write("play", "pause");
    this.playing = performance.now();
    const step = (now: number) => {
      if (!this.playing) return;
      const next = this.time + (Math.max(0, now - this.playing) / 1000) * SPEEDS[Number(element<HTMLInputElement>("speed").value)];
      this.playing = now;
      this.showTime(next, true);
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
    const download = (href: string, kind: string) => Object.assign(document.createElement("a"), { href, download: `${this.page.name}.${kind}` }).click();
    const speed = element<HTMLInputElement>("speed");
    speed.addEventListener("input", () => write("speed-text", `${SPEEDS[Number(speed.value)]} x`));
    const look = element<HTMLSelectElement>("look");
    look.addEventListener("change", () => this.view?.look(look.value));
    for (const what of ["section", "frames", "surroundings", "robot"] as const) {
      const box = element<HTMLInputElement>(what);
      box.addEventListener("change", () => this.view?.show(what, box.checked));
    }
    element<HTMLInputElement>("line").addEventListener("change", () => this.shown?.time != null && this.showTime(this.time));
    element("save").addEventListener("click", async () => download(URL.createObjectURL((await this.view?.save()) ?? new Blob()), "glb"));
    element("picture").addEventListener("click", () => download(element<HTMLCanvasElement>("view").toDataURL(), "png"));
    const paint = element<HTMLSelectElement>("paint");
    paint.addEventListener("change", () => this.paintPasses(paint.value));
    this.paintPasses(paint.value);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.view?.recolour());
  }

  private paintPasses(what: string): void {
    const paint = this.page.paints[what];
    element("scale").hidden = paint === undefined;
    write("scale-low", paint?.low ?? "");
    write("scale-high", paint?.high ?? "");
    this.view?.colourPasses(paint === undefined ? null : Float32Array.from(this.block.array(paint.colours), (value) => value / 255));
  }
}

const write = (id: string, text: string) => Object.assign(element(id), { textContent: text });
const hover = (text: string) => write("hover", text);

async function start(): Promise<void> {
  const page: Page = JSON.parse(element("page-data").textContent ?? "");
  const block = await Block.inflate((element("page-block").textContent ?? "").trim());
  Object.assign(window, { opl: new Viewer(page, block) }); // for use at the console, and in tests
  document.body.classList.add("ready");
}

start().catch((error) => {
  write("posture", `This page could not be opened: ${error}`);
  throw error;
});
