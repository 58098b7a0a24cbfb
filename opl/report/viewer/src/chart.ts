// The contact chart: what every cutter point is at every contact position, and the path through it.

import { type Block, element, type Page, type Unpacking } from "./data";

const FREE = 0;
const NEAR_SINGULAR = 0.1; // of the margin that is 0 at a singularity

// the clearance in m as measured at the cell nearest to this one, if there
export type Cell = { point: number; t: number; state: number; q: number[] | null; hit: string[]; clearance: number | null; text: string };

export class ContactChart {
  readonly count: number;
  readonly t: ArrayLike<number>;
  private readonly arrays: Unpacking<NonNullable<Page["field"]>>;
  private readonly frame = element("chart");
  private readonly field: NonNullable<Page["field"]>;
  private at = { point: 0, position: 0 };

  constructor(private readonly page: Page, block: Block, private readonly chosen: (cell: Cell) => void, describe: (text: string) => void) {
    const field = page.field;
    if (field === null) throw new Error("a chart needs nodes");
    this.field = field;
    this.count = field.states.shape[0];
    this.arrays = block.all(field);
    this.t = this.arrays.t;
    this.at.position = Math.floor(this.t.length / 2);
    this.frame.addEventListener("pointermove", (event) => describe(this.cell(this.under(event)).text));
    this.frame.addEventListener("click", (event) => this.choose(this.under(event)));
    this.frame.addEventListener("keydown", (event) => this.move(event));
  }

  cell({ point, position }: { point: number; position: number }): Cell {
    const { field, arrays } = this;
    const rows = this.t.length;
    const node = point * rows + position;
    const state = arrays.states[node];
    const reached = !Number.isNaN(arrays.q[node]);
    const q = reached ? Array.from({ length: 6 }, (_, joint) => arrays.q[joint * this.count * rows + node]) : null;
    const struck = arrays.hit[node];
    const sample = nearest(arrays.columns, point) * arrays.positions.length + nearest(arrays.positions, position);
    const clearance = state === FREE && !Number.isNaN(arrays.clearance[sample]) ? arrays.clearance[sample] : null;
    const near = clearance === null ? [] : field.near_pairs[arrays.nearest[sample]] ?? [];
    const hit = state === 3 ? ["part", "wheel"] : struck >= 0 ? field.pairs[struck] : [];
    let text = `cutter point ${point}, t ${this.t[position].toFixed(2)}: ${field.names[state]}`;
    if (struck >= 0) text += `: ${hit.join(" and ")}`;
    if (state === 2 && q !== null) text += this.beyond(q);
    if (clearance !== null) text += `, about ${(1e3 * clearance).toFixed(1)} mm clear (${near.join(" and ")})`;
    if (reached && arrays.singularity[node] < NEAR_SINGULAR) text += ", near a singularity";
    return { point, t: this.t[position], state, q, hit, clearance, text };
  }

  choose(place: { point: number; position: number }): void {
    this.at = place;
    this.chosen(this.cell(place));
  }

  nearestTo = (point: number, t: number) => ({ point: Math.round(point), position: nearest(this.t, t) });

  // Where the robot is now; null off the wheel.
  cursor(point: number | null, t: number | null): void {
    const mark = element("chart-cursor");
    mark.hidden = point === null || t === null;
    if (point === null || t === null) return;
    const rows = this.t.length;
    const step = rows > 1 ? (this.t[rows - 1] - this.t[0]) / (rows - 1) : 1;
    const [across, down] = [(point + 0.5) / this.count, (rows - 0.5 - (t - this.t[0]) / step) / rows]; // half a cell in is its middle
    mark.style.transform = `translate(${100 * across}%, ${100 * down}%)`;
  }

  private under(event: MouseEvent): { point: number; position: number } {
    const box = this.frame.getBoundingClientRect();
    const across = (event.clientX - box.left) / box.width;
    return this.within(across * this.count, (1 - (event.clientY - box.top) / box.height) * this.t.length);
  }

  private move(event: KeyboardEvent): void {
    const far = event.shiftKey ? 10 : 1;
    const [across, up] = { ArrowLeft: [-far, 0], ArrowRight: [far, 0], ArrowUp: [0, far], ArrowDown: [0, -far] }[event.key] ?? [0, 0];
    if (across === 0 && up === 0) return;
    event.preventDefault();
    this.choose(this.within(this.at.point + across, this.at.position + up));
  }

  private within(point: number, position: number): { point: number; position: number } {
    const kept = (place: number, count: number) => Math.max(0, Math.min(count - 1, Math.floor(place)));
    return { point: kept(point, this.count), position: kept(position, this.t.length) };
  }

  private beyond(q: number[]): string {
    const out = this.page.joints.filter((joint, k) => q[k] < joint.lower || q[k] > joint.upper).map((joint) => joint.name);
    return out.length > 0 ? `: ${out.join(" ")}` : ": a sum of joints";
  }
}

function nearest(sorted: ArrayLike<number>, value: number): number {
  let best = 0;
  for (let k = 1; k < sorted.length; k++) if (Math.abs(sorted[k] - value) < Math.abs(sorted[best] - value)) best = k;
  return best;
}
