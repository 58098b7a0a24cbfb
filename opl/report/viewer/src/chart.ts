// The contact chart: what every cutter point is at every contact position, and the path through it.

import { type Block, colour, element, type Page } from "./data";

const FREE = 0;
const NEAR_SINGULAR = 0.1; // of the margin that is 0 at a singularity

// Each state has a hatch beside its colour, for eyes and printers that see no hue.
const HATCHES: Record<number, (g: CanvasRenderingContext2D) => void> = {
  1: (g) => strokes(g, [[0, 4, 8, 4], [4, 0, 4, 8]]),
  2: (g) => strokes(g, [[1, 1, 3, 3], [5, 5, 7, 7]]),
  3: (g) => strokes(g, [[0, 8, 8, 0]]),
  4: (g) => strokes(g, [[0, 0, 8, 8], [0, 4, 4, 8], [4, 0, 8, 4]]),
};

function strokes(g: CanvasRenderingContext2D, lines: number[][]): void {
  for (const [x0, y0, x1, y1] of lines) {
    g.moveTo(x0, y0);
    g.lineTo(x1, y1);
  }
}

export interface Cell {
  point: number;
  position: number;
  t: number;
  state: number;
  q: number[] | null;
  hit: string[];
  clearance: number | null; // [m], as measured at the cell nearest to this one
  near: string[];
  singular: boolean;
  text: string;
}

export class ContactChart {
  readonly count: number;
  readonly t: ArrayLike<number>;
  private readonly states: ArrayLike<number>;
  private readonly arrays: Record<"q" | "hit" | "singularity" | "columns" | "positions" | "clearance" | "nearest", ArrayLike<number>>;
  private readonly canvas = element<HTMLCanvasElement>("chart-cells");
  private readonly field: NonNullable<Page["field"]>;
  private at = { point: 0, position: 0 };

  constructor(private readonly page: Page, block: Block, private readonly chosen: (cell: Cell) => void, private readonly told: (text: string) => void) {
    const field = page.field;
    if (field === null || page.points === null) throw new Error("a chart needs nodes");
    this.field = field;
    this.t = block.array(field.t);
    this.states = block.array(field.states);
    this.count = block.array(page.points.pass).length;
    this.arrays = {
      q: block.array(field.q), hit: block.array(field.hit), singularity: block.array(field.singularity),
      columns: block.array(field.columns), positions: block.array(field.positions),
      clearance: block.array(field.clearance), nearest: block.array(field.nearest),
    };
    this.at.position = Math.floor(this.t.length / 2);
    new ResizeObserver(() => this.drawCells()).observe(this.canvas);
    const frame = element<HTMLElement>("chart");
    frame.addEventListener("pointermove", (event) => this.told(this.cell(this.under(event)).text));
    frame.addEventListener("click", (event) => this.choose(this.under(event)));
    frame.addEventListener("keydown", (event) => this.move(event));
  }

  cell({ point, position }: { point: number; position: number }): Cell {
    const { field, arrays } = this;
    const rows = this.t.length;
    const node = point * rows + position;
    const state = this.states[node];
    const reached = !Number.isNaN(arrays.q[node]);
    const q = reached ? Array.from({ length: 6 }, (_, joint) => arrays.q[joint * this.count * rows + node]) : null;
    const struck = arrays.hit[node];
    const singular = arrays.singularity[node] < NEAR_SINGULAR;
    const sample = nearest(arrays.columns, point) * arrays.positions.length + nearest(arrays.positions, position);
    const clearance = state === FREE && !Number.isNaN(arrays.clearance[sample]) ? arrays.clearance[sample] : null;
    const near = clearance === null ? [] : field.near_pairs[arrays.nearest[sample]] ?? [];
    const hit = state === 3 ? ["part", "wheel"] : struck >= 0 ? field.pairs[struck] : [];
    let text = `cutter point ${point}, t ${this.t[position].toFixed(2)}: ${field.names[state]}`;
    if (struck >= 0) text += `: ${hit.join(" and ")}`;
    if (state === 2 && q !== null) text += this.beyond(q);
    if (clearance !== null) text += `, about ${(1e3 * clearance).toFixed(1)} mm clear (${near.join(" and ")})`;
    if (singular && reached) text += ", near a singularity";
    return { point, position, t: this.t[position], state, q, hit, clearance, near, singular, text };
  }

  choose(place: { point: number; position: number }): void {
    this.at = place;
    this.chosen(this.cell(place));
  }

  nearestTo(point: number, t: number): { point: number; position: number } {
    return { point: Math.round(point), position: nearest(this.t, t) };
  }

  // Where the robot is now; null off the wheel.
  cursor(point: number | null, t: number | null): void {
    const mark = element<HTMLElement>("chart-cursor");
    mark.hidden = point === null || t === null;
    if (point !== null && t !== null) {
      const [x, y] = this.toPlot(point, t);
      mark.style.left = `${(100 * x) / this.count}%`;
      mark.style.top = `${(100 * y) / this.t.length}%`;
    }
  }

  drawCells(): void {
    const { canvas } = this;
    const width = Math.round(canvas.clientWidth * devicePixelRatio);
    const height = Math.round(canvas.clientHeight * devicePixelRatio);
    if (width === 0 || height === 0) return;
    canvas.width = width;
    canvas.height = height;
    const g = canvas.getContext("2d");
    if (g === null) return;
    const rows = this.t.length;
    const image = new ImageData(this.count, rows);
    const plain = [0, 1, 2, 3, 4].map((state) => rgb(colour(`state-${state}`)));
    const masks = new Map([1, 2, 3, 4].map((state) => [state, new ImageData(this.count, rows)]));
    const singular = new ImageData(this.count, rows);
    for (let point = 0; point < this.count; point++) {
      for (let position = 0; position < rows; position++) {
        const { state, clearance, singular: near } = this.cell({ point, position });
        const pixel = 4 * ((rows - 1 - position) * this.count + point);
        image.data.set(state === FREE && clearance !== null ? shade(clearance) : plain[state], pixel);
        masks.get(state)?.data.set([0, 0, 0, 255], pixel);
        if (near && state === FREE) singular.data.set([0, 0, 0, 255], pixel);
      }
    }
    g.imageSmoothingEnabled = false;
    g.drawImage(bitmap(image), 0, 0, width, height);
    for (const [state, mask] of masks) this.hatch(g, mask, HATCHES[state], width, height);
    this.hatch(g, singular, (tile) => tile.arc(4, 4, 2, 0, 7), width, height);
  }

  private hatch(g: CanvasRenderingContext2D, mask: ImageData, draw: (g: CanvasRenderingContext2D) => void, width: number, height: number): void {
    const tile = document.createElement("canvas");
    tile.width = tile.height = 8;
    const pen = tile.getContext("2d");
    const layer = document.createElement("canvas");
    layer.width = width;
    layer.height = height;
    const over = layer.getContext("2d");
    if (pen === null || over === null) return;
    pen.strokeStyle = "#000a";
    pen.lineWidth = 0.7;
    draw(pen);
    pen.stroke();
    over.fillStyle = over.createPattern(tile, "repeat") ?? "#0000";
    over.fillRect(0, 0, width, height);
    over.globalCompositeOperation = "destination-in";
    over.imageSmoothingEnabled = false;
    over.drawImage(bitmap(mask), 0, 0, width, height);
    g.drawImage(layer, 0, 0);
  }

  // In cells from the top left: the middle of a cell is half a cell in.
  private toPlot(point: number, t: number): [number, number] {
    const rows = this.t.length;
    const step = rows > 1 ? (this.t[rows - 1] - this.t[0]) / (rows - 1) : 1;
    return [point + 0.5, rows - 0.5 - (t - this.t[0]) / step];
  }

  private under(event: MouseEvent): { point: number; position: number } {
    const box = this.canvas.getBoundingClientRect();
    const within = (part: number, count: number) => Math.max(0, Math.min(count - 1, Math.floor(part * count)));
    return {
      point: within((event.clientX - box.left) / box.width, this.count),
      position: within(1 - (event.clientY - box.top) / box.height, this.t.length),
    };
  }

  private move(event: KeyboardEvent): void {
    const far = event.shiftKey ? 10 : 1;
    const [across, up] = { ArrowLeft: [-far, 0], ArrowRight: [far, 0], ArrowUp: [0, far], ArrowDown: [0, -far] }[event.key] ?? [0, 0];
    if (across === 0 && up === 0) return;
    event.preventDefault();
    this.choose({
      point: Math.max(0, Math.min(this.count - 1, this.at.point + across)),
      position: Math.max(0, Math.min(this.t.length - 1, this.at.position + up)),
    });
  }

  private beyond(q: number[]): string {
    const out = this.page.joints.filter((joint, k) => q[k] < joint.lower || q[k] > joint.upper).map((joint) => joint.name);
    return out.length > 0 ? `: ${out.join(" ")}` : ": a sum of joints";
  }
}

function bitmap(image: ImageData): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = image.width;
  canvas.height = image.height;
  canvas.getContext("2d")?.putImageData(image, 0, 0);
  return canvas;
}

function nearest(sorted: ArrayLike<number>, value: number): number {
  let best = 0;
  for (let k = 1; k < sorted.length; k++) if (Math.abs(sorted[k] - value) < Math.abs(sorted[best] - value)) best = k;
  return best;
}

function rgb(hex: string): number[] {
  const number = Number.parseInt(hex.slice(1), 16);
  return [number >> 16, (number >> 8) & 255, number & 255, 255];
}

// White where nothing is near, darker the less room there is; logarithmic from 5 to 100 mm.
function shade(clearance: number): number[] {
  const room = Math.max(0, Math.min(1, Math.log(Math.max(clearance, 1e-4) / 0.005) / Math.log(20)));
  return [150 + 98 * room, 195 + 56 * room, 170 + 79 * room, 255].map(Math.round);
}

// From dark blue over green to yellow, evenly lighter; for a part from 0 to 1.
export function scaleColour(part: number): [number, number, number] {
  const stops = [[0.27, 0.0, 0.33], [0.23, 0.32, 0.55], [0.13, 0.57, 0.55], [0.37, 0.79, 0.38], [0.99, 0.91, 0.14]];
  const place = Math.max(0, Math.min(1, Number.isNaN(part) ? 0 : part)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(place));
  const [low, high] = [stops[k], stops[k + 1]];
  return [0, 1, 2].map((c) => low[c] + (place - k) * (high[c] - low[c])) as [number, number, number];
}
