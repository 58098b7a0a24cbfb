// Curves against time, one panel under the other, with one cursor through all of them.

import type { Block, Panel, Unpacked } from "./data";

type Line = { name: string; kind: string; xs: Unpacked; ys: Unpacked };

const [WIDTH, HEIGHT] = [1000, 120];

export class Curves {
  private readonly line = Object.assign(document.createElement("div"), { className: "cursor" }); // over all panels

  constructor(
    home: HTMLElement,
    panels: Panel[],
    private readonly end: number, // time in s
    private readonly block: Block,
    private readonly chosen: (time: number) => void,
    private readonly told: (text: string) => void,
  ) {
    home.replaceChildren(...panels.map((panel) => this.figure(panel)), this.line);
  }

  cursor(time: number | null): void {
    this.line.hidden = time === null;
    this.line.style.left = `${(100 * (time ?? 0)) / (this.end || 1)}%`;
  }

  private across(time: number): number {
    return (WIDTH * time) / (this.end || 1);
  }

  private figure(panel: Panel): HTMLElement {
    const lines = panel.lines.map((line) => ({ name: line.name, kind: line.kind, xs: this.block.array(line.x), ys: this.block.array(line.y) }));
    let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
    for (const line of lines.filter(({ kind }) => kind !== "limit")) {
      for (const y of line.ys) if (!Number.isNaN(y)) [low, high] = [Math.min(low, y), Math.max(high, y)];
    }
    if (low > high) [low, high] = [0, 1];
    const title = `${panel.title}: ${low.toFixed(2)} to ${high.toFixed(2)} ${panel.unit}`;
    const room = Math.max(high - low, 1e-3);
    for (const { kind, ys } of lines) { // a limit is shown only where a curve comes near to it
      if (kind === "limit" && Math.abs(ys[0] - (low + high) / 2) < 1.2 * room) [low, high] = [Math.min(low, ys[0]), Math.max(high, ys[0])];
    }
    const margin = 0.06 * Math.max(high - low, 1e-3);
    const up = (y: number) => HEIGHT - (HEIGHT * (y - low + margin)) / (high - low + 2 * margin);
    const svg = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": title });
    for (const line of lines) {
      const { kind, ys, name } = line;
      const drawn = kind === "range"
        ? shape("rect", { x: "0", y: `${up(ys[1])}`, width: `${WIDTH}`, height: `${up(ys[0]) - up(ys[1])}`, class: kind })
        : shape("path", { d: this.path(line, up), class: kind, "vector-effect": "non-scaling-stroke" });
      const tip = shape("title", {});
      tip.textContent = name;
      drawn.append(tip);
      svg.append(drawn);
    }
    const caption = Object.assign(document.createElement("figcaption"), { textContent: title });
    const figure = document.createElement("figure");
    figure.append(caption, svg);
    const time = (event: MouseEvent) => {
      const box = svg.getBoundingClientRect();
      return (this.end * Math.max(0, Math.min(box.width, event.clientX - box.left))) / box.width;
    };
    svg.addEventListener("pointermove", (event) => this.told(this.tell(panel, lines, time(event as MouseEvent))));
    svg.addEventListener("click", (event) => this.chosen(time(event as MouseEvent)));
    return figure;
  }

  private path({ kind, xs, ys }: Line, up: (y: number) => number): string {
    const step = kind.includes("step");
    let d = "";
    for (let k = step ? 1 : 0; k < ys.length; k++) {
      if (Number.isNaN(ys[k])) continue;
      const [x, y] = [this.across(xs[k]).toFixed(1), up(ys[k]).toFixed(1)];
      if (step) d += `M${this.across(xs[k - 1]).toFixed(1)} ${y}H${x}`;
      else d += `${k === 0 || Number.isNaN(ys[k - 1]) ? "M" : "L"}${x} ${y}`;
    }
    return d;
  }

  private tell(panel: Panel, lines: Line[], time: number): string {
    const parts = lines.filter(({ kind }) => !/limit|range|blame/.test(kind)).map(({ name, kind, xs, ys }) => {
      const k = after(xs, time);
      const part = k > 0 && xs[k] > xs[k - 1] ? (time - xs[k - 1]) / (xs[k] - xs[k - 1]) : 1;
      const y = k > 0 && !kind.includes("step") ? ys[k - 1] + part * (ys[k] - ys[k - 1]) : ys[k];
      const label = panel.labels === undefined ? "" : `, ${panel.labels.names[this.block.array(panel.labels.codes)[k]]}`;
      return Number.isNaN(y) ? `${name}: nothing here` : `${name} ${y.toFixed(2)}${label}`;
    });
    return `${panel.title} in ${panel.unit} at ${time.toFixed(2)} s: ${parts.join("; ")}`;
  }
}

// The index of the first of increasing times that is not before a time.
export function after(times: ArrayLike<number>, time: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

function shape(tag: string, attributes: Record<string, string>): SVGElement {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}
