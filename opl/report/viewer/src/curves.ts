// Curves against time, one panel under the other, with one cursor through all of them.

import type { Block, Panel, Unpacked } from "./data";

type Line = { name: string; kind: string; xs: Unpacked; ys: Unpacked };

const [WIDTH, HEIGHT] = [1000, 120];

export class Curves {
  private readonly line = Object.assign(document.createElement("div"), { className: "cursor" }); // as wide as the panels, over all of them

  constructor(home: HTMLElement, panels: Panel[], private readonly end: number, private readonly block: Block, // end in s
    private readonly chosen: (time: number) => void, private readonly describe: (text: string) => void) {
    const ticks = [0, 0.25, 0.5, 0.75, 1].map((part) => `${(part * end).toFixed(1)} s`);
    home.replaceChildren(...panels.map((panel) => this.figure(panel)), this.line, labels("ends", ticks));
  }

  cursor(time: number | null): void {
    this.line.hidden = time === null;
    this.line.style.transform = `translateX(${(100 * (time ?? 0)) / (this.end || 1)}%)`;
  }

  private across(time: number): number {
    return (WIDTH * time) / (this.end || 1);
  }

  private figure(panel: Panel): HTMLElement {
    const lines = panel.lines.map((line) => ({ name: line.name, kind: line.kind, xs: this.block.array(line.x), ys: this.block.array(line.y) }));
    const { low, high, caption } = panel;
    const up = (y: number) => HEIGHT - (HEIGHT * (y - low)) / (high - low);
    const svg = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": caption });
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
    const figure = document.createElement("figure");
    const ends = [high, low].map((y) => y.toPrecision(3));
    figure.append(Object.assign(document.createElement("figcaption"), { textContent: caption }), labels("axis", ends), svg);
    const time = (event: MouseEvent) => {
      const box = svg.getBoundingClientRect();
      return (this.end * Math.max(0, Math.min(box.width, event.clientX - box.left))) / box.width;
    };
    svg.addEventListener("pointermove", (event) => this.describe(this.text(panel, lines, time(event as MouseEvent))));
    svg.addEventListener("click", (event) => this.chosen(time(event as MouseEvent)));
    return figure;
  }

  private path({ kind, xs, ys }: Line, up: (y: number) => number): string {
    const step = kind.includes("step");
    let d = "";
    for (let k = step ? 1 : 0; k < ys.length; k++) {
      if (Number.isNaN(ys[k])) continue;
      const [x, y] = [this.across(xs[k]).toFixed(1), up(ys[k]).toFixed(1)];
      if (step) d += `${k === 1 || Number.isNaN(ys[k - 1]) ? `M${this.across(xs[k - 1]).toFixed(1)} ` : "V"}${y}H${x}`;
      else d += `${k === 0 || Number.isNaN(ys[k - 1]) ? "M" : "L"}${x} ${y}`;
    }
    return d;
  }

  private text(panel: Panel, lines: Line[], time: number): string {
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
    [low, high] = times[middle] < time ? [middle + 1, high] : [low, middle];
  }
  return low;
}

function labels(className: string, texts: string[]): HTMLElement {
  const home = Object.assign(document.createElement("div"), { className });
  home.append(...texts.map((textContent) => Object.assign(document.createElement("span"), { textContent })));
  return home;
}

function shape(tag: string, attributes: Record<string, string>): SVGElement {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}
