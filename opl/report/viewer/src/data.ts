// What a page carries, and how its arrays are unpacked. Lengths are in m, angles in rad, times in s.

// with a scale the numbers are differences of 16 bits
export type Packed = { at: number; kind: "f32" | "u8" | "i16" | "i32"; shape: number[]; scale?: number };

type Arrays<Names extends string> = Record<Names, Packed>;
export type Unpacked = ReturnType<Block["array"]>;
export type Unpacking<R> = { [Name in keyof R as R[Name] extends Packed ? Name : never]: Unpacked };

export type Solid = {
  name: string; robot: boolean; around: boolean; colour: number; T: number[]; vertices: Packed; faces: Packed;
  joint: number; // how many joints move it
};

// from low to high is shown; a "step" line holds from the place before
export type Panel = {
  title: string; unit: string; caption: string; low: number; high: number;
  lines: { name: string; kind: string; x: Packed; y: Packed }[]; labels?: { codes: Packed; names: string[] };
};

export interface Page {
  name: string;
  joints: { name: string; lower: number; upper: number }[];
  cell: { joints: { T: number[]; axis: number[] }[]; flange: number[]; solids: Solid[] };
  views: Record<string, [number, number, number][]>; // eye and what it looks at
  home: number[] | null;
  wheel: { flat_end: number; T_base_contact0: number[] } | null;
  points: Arrays<"frames" | "pass" | "edges" | "line" | "triads" | "missed"> | null;
  field: (Arrays<"t" | "states" | "q" | "hit" | "singularity" | "columns" | "positions" | "clearance" | "nearest"> &
    { names: string[]; pairs: string[][]; near_pairs: string[][] }) | null;
  motion: (Arrays<"q" | "time" | "t" | "point" | "pass" | "kind"> & { kinds: string[] }) | null;
  clearance: (Arrays<"time" | "distance" | "pair" | "points"> & { pairs: string[][] }) | null;
  curves: Record<string, Panel[]>;
  paints: Record<string, { low: string; high: string; colours: Packed }>; // three numbers a cutter point, up to 255
  program: { texts: Packed[]; lines: Packed } | null; // file, line and move, three numbers a move
  marks: Record<string, Mark>;
}

// a place that a row of a table leads to: a configuration, a move of the motion, or a cell
export type Mark = { q?: number[]; move?: number; point?: number; t?: number; hit?: string[]; text: string };

export class Block {
  private constructor(private readonly bytes: ArrayBuffer) {}

  static async inflate(base64: string): Promise<Block> {
    const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Block(await new Response(stream).arrayBuffer());
  }

  array({ at, kind, shape, scale }: Packed): Float32Array<ArrayBuffer> | Uint8Array<ArrayBuffer> | Int16Array<ArrayBuffer> | Int32Array<ArrayBuffer> {
    const count = shape.reduce((product, size) => product * size, 1);
    if (kind === "u8") return new Uint8Array(this.bytes, at, count);
    if (kind === "i32") return new Int32Array(this.bytes, at, count);
    if (kind === "f32") return new Float32Array(this.bytes, at, count);
    const whole = new Int16Array(this.bytes, at, count);
    if (scale === undefined) return whole;
    const [values, absent] = [new Float32Array(count), -32768];
    for (let k = 0, sum = 0; k < count; k++) {
      sum = ((sum + whole[k] + 32768) & 65535) - 32768; // wraps around, as it was packed
      values[k] = sum === absent ? Number.NaN : sum * scale;
    }
    return values;
  }

  // Every array of a record, under its name.
  all<R extends object>(record: R): Unpacking<R> {
    const packed = Object.entries(record).filter(([, value]) => typeof value.at === "number");
    return Object.fromEntries(packed.map(([name, value]) => [name, this.array(value)])) as Unpacking<R>;
  }

  text = (packed: Packed): string => new TextDecoder().decode(this.array(packed));
}

export const degrees = (angle: number): number => (angle * 180) / Math.PI;

export const element = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

export const colour = (name: string): string => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
