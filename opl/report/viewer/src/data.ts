// What a page carries, and how its arrays are unpacked. Lengths are in m, angles in rad, times in s.

export interface Packed {
  at: number;
  kind: "f32" | "u8" | "i16" | "i32";
  shape: number[];
  scale?: number; // of arrays whose numbers are differences of 16 bits
}

export interface Solid {
  name: string;
  joint: number; // how many joints move it
  robot: boolean;
  T: number[];
  kind: "box" | "cylinder" | "mesh";
  size?: number[];
  vertices?: Packed;
  faces?: Packed;
}

export interface CurveLine {
  name: string;
  kind: string; // its classes; "step": the value holds from the place before
  x: Packed;
  y: Packed;
}

export interface Panel {
  title: string;
  unit: string;
  lines: CurveLine[];
  labels?: { codes: Packed; names: string[] };
}

export interface Page {
  joints: { name: string; lower: number; upper: number }[];
  cell: { joints: { T: number[]; axis: number[] }[]; flange: number[]; solids: Solid[] };
  home: number[] | null;
  wheel: { flat_end: number; last: number; radius: number; width: number; T_base_contact0: number[] } | null;
  points: Record<"frames" | "pass" | "edges" | "line" | "triads" | "missed", Packed> | null;
  field: (Record<"t" | "states" | "q" | "hit" | "singularity" | "columns" | "positions" | "clearance" | "nearest", Packed> &
    { names: string[]; pairs: string[][]; near_pairs: string[][] }) | null;
  motion: (Record<"q" | "time" | "t" | "point" | "pass" | "kind", Packed> & { kinds: string[] }) | null;
  clearance: (Record<"time" | "distance" | "pair" | "points", Packed> & { pairs: string[][] }) | null;
  curves: Record<string, Panel[]>;
  paints: Record<string, { unit: string; values: Packed }>; // of each cutter point
  marks: Record<string, Mark>;
}

// a place that a row of a table leads to: a configuration, a move of the motion, or a cell
export interface Mark {
  q?: number[];
  move?: number;
  point?: number;
  t?: number;
  hit?: string[];
  text: string;
}

const ABSENT = -32768;

export class Block {
  private constructor(private readonly bytes: ArrayBuffer) {}

  static async inflate(base64: string): Promise<Block> {
    const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Block(await new Response(stream).arrayBuffer());
  }

  array(packed: Packed): Float32Array | Uint8Array | Int16Array | Int32Array {
    const count = packed.shape.reduce((product, size) => product * size, 1);
    switch (packed.kind) {
      case "u8":
        return new Uint8Array(this.bytes, packed.at, count);
      case "i32":
        return new Int32Array(this.bytes, packed.at, count);
      case "f32":
        return new Float32Array(this.bytes, packed.at, count);
      case "i16": {
        const whole = new Int16Array(this.bytes, packed.at, count);
        return packed.scale === undefined ? whole : summed(whole, packed.scale);
      }
    }
  }
}

function summed(steps: Int16Array, scale: number): Float32Array {
  const values = new Float32Array(steps.length);
  let sum = 0;
  for (let k = 0; k < steps.length; k++) {
    sum = ((sum + steps[k] + 32768) & 65535) - 32768; // wraps around, as it was packed
    values[k] = sum === ABSENT ? Number.NaN : sum * scale;
  }
  return values;
}

export const degrees = (angle: number): number => (angle * 180) / Math.PI;

export function element<T extends Element>(id: string): T {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page lacks #${id}`);
  return found as unknown as T;
}

export const colour = (name: string): string =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
