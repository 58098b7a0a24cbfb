// The cell in three dimensions: posed, looked at from somewhere, cut open, coloured.

import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, EdgesGeometry, Group, Light, Line,
  LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, MeshStandardMaterial, Object3D, PerspectiveCamera, Plane, Points, PointsMaterial, Scene,
  SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { GLTFExporter } from "three/examples/jsm/exporters/GLTFExporter.js";
import { type Block, colour, type Packed, type Page, type Solid } from "./data";

const RED = 0xd03030;
const [COARSE, FAST, SLOW, ENOUGH] = [0.5, 20, 40, 6]; // pixels for one of the page, ms of a picture, and how many of them decide
type Wheel = NonNullable<Page["wheel"]>;
type Drawn = Mesh<BufferGeometry, MeshLambertMaterial>;

export const matrix = (T: ArrayLike<number>): Matrix4 =>
  new Matrix4().set(T[0], T[1], T[2], T[3], T[4], T[5], T[6], T[7], T[8], T[9], T[10], T[11], 0, 0, 0, 1);

// The contact frame at contact position t: slid along x on the flat, rolled about y at the edges.
export function contactFrame(wheel: Wheel, t: number): Matrix4 {
  const slide = Math.max(-wheel.flat_end, Math.min(wheel.flat_end, t));
  const roll = ((t - slide) * Math.PI) / 180;
  return matrix(wheel.T_base_contact0).multiply(new Matrix4().makeRotationY(roll).setPosition(-slide / 1000, 0, 0));
}

export class CellView {
  private readonly camera = new PerspectiveCamera(35, 1, 0.01, 50);
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly controls: OrbitControls;
  private readonly joints: Group[] = [];
  private readonly rest: Matrix4[];
  private readonly axes: Vector3[];
  private readonly bodies = new Map<string, Drawn[]>();
  private readonly dot = new Mesh(new SphereGeometry(0.003, 16, 12), new MeshBasicMaterial({ color: RED, depthTest: false }));
  private readonly nearest = new Line(new BufferGeometry(), new LineBasicMaterial({ color: RED, depthTest: false }));
  private ghost = new Group();
  private ribbon: Mesh | null = null;
  private trace: LineSegments | null = null;
  private ends: number[] = []; // of the trace up to each cutter point
  private frames: LineSegments | null = null;
  private red: string[] = [];
  private waiting = false;
  private settling = 0;
  private moving = COARSE;
  private balance = 0; // fast pictures less slow ones
  private before = 0; // when the last one was requested
  drawn = 0; // pictures made up to now

  constructor(private readonly canvas: HTMLCanvasElement, private readonly page: Page, private readonly block: Block) {
    this.renderer = new WebGLRenderer({ canvas, preserveDrawingBuffer: true }); // kept for printing
    this.camera.up.set(0, 0, 1);
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    for (const [x, y, z, much] of [[2, -3, 4, 2.2], [-3, 2, 1, 0.8]]) {
      const light = new DirectionalLight(0xffffff, much);
      this.scene.add(light.translateX(x).translateY(y).translateZ(z));
    }
    this.rest = page.cell.joints.map((joint) => matrix(joint.T));
    this.axes = page.cell.joints.map((joint) => new Vector3(...joint.axis));
    for (const T of this.rest) {
      const joint = placed(new Group(), T);
      (this.joints.at(-1) ?? this.scene).add(joint);
      this.joints.push(joint);
    }
    for (const solid of page.cell.solids) this.add(solid);
    this.dot.renderOrder = this.nearest.renderOrder = 3;
    this.dot.visible = this.nearest.visible = false;
    this.scene.add(this.dot, this.nearest, this.ghost);
    if (page.points !== null) this.addPasses(page.points);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.listenToKeyEvents(canvas);
    this.controls.keyPanSpeed = 20;
    this.controls.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.recolour();
    this.fit();
    this.look(Object.keys(page.views)[0]);
  }

  pose(q: ArrayLike<number>): void {
    this.joints.forEach((joint, k) => {
      joint.matrix.copy(this.rest[k]).multiply(new Matrix4().makeRotationAxis(this.axes[k], q[k]));
      joint.matrixWorldNeedsUpdate = true;
    });
    this.draw();
  }

  // Show the part where no arm can bring it, T_base_workpiece; null takes it away.
  phantom(T: Matrix4 | null): void {
    this.ghost.clear();
    if (T !== null) {
      const pale = new MeshLambertMaterial({ color: 0x8a5f9e, transparent: true, opacity: 0.55 });
      for (const mesh of this.bodies.get("part") ?? []) this.ghost.add(placed(new Mesh(mesh.geometry, pale), T));
    }
    this.draw();
  }

  contact(t: number | null): void {
    this.dot.visible = t !== null && this.page.wheel !== null;
    if (t !== null && this.page.wheel !== null) this.dot.position.setFromMatrixPosition(contactFrame(this.page.wheel, t));
  }

  line(ends: number[] | null): void {
    this.nearest.visible = ends !== null;
    if (ends !== null) this.nearest.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(ends), 3));
  }

  // Bodies that collide get red and dark edges, so that they are recognised without colour too.
  mark(names: string[]): void {
    for (const name of [...this.red, ...names]) {
      const red = names.includes(name);
      for (const mesh of this.bodies.get(name) ?? []) {
        mesh.material.color.set(red ? RED : mesh.userData.colour);
        mesh.material.opacity = red ? Math.max(0.6, mesh.userData.opacity) : mesh.userData.opacity;
        ((mesh.children[0] as LineSegments).material as LineBasicMaterial).opacity = red ? 1 : 0.4;
      }
    }
    this.red = names;
    this.draw();
  }

  ground(upTo: number): void {
    this.trace?.geometry.setDrawRange(0, this.ends[Math.floor(upTo)] ?? 0);
  }

  // Colours along the passes, three numbers a cutter point; null hides them.
  colourPasses(colours: Float32Array | null): void {
    if (this.ribbon === null) return;
    this.ribbon.visible = colours !== null;
    if (colours !== null) { // both edges of the band at a cutter point are of one colour
      const both = Float32Array.from({ length: 2 * colours.length }, (_, k) => linear(colours[3 * Math.floor(k / 6) + (k % 3)]));
      this.ribbon.geometry.setAttribute("color", new BufferAttribute(both, 3));
    }
    this.draw();
  }

  show(what: "section" | "frames" | "surroundings" | "robot", on: boolean): void {
    if (what === "frames" && this.frames !== null) this.frames.visible = on;
    if (what === "section") this.renderer.clippingPlanes = on && this.page.wheel !== null ? [this.cut(this.page.wheel)] : [];
    for (const solid of this.page.cell.solids) {
      if (what !== (solid.robot ? "robot" : solid.around ? "surroundings" : "")) continue;
      for (const mesh of this.bodies.get(solid.name) ?? []) mesh.visible = on;
    }
    this.draw();
  }

  look(from: string): void {
    const [eye, target] = this.page.views[from].map((place) => new Vector3(...place));
    this.controls.target.copy(target); // a narrow screen needs more distance
    this.camera.position.copy(target).addScaledVector(eye.sub(target), Math.max(1, 1.3 / this.camera.aspect));
    this.controls.update();
    this.draw();
  }

  // The cell as it is posed, as binary glTF.
  async save(): Promise<Blob> {
    const copy = this.scene.clone();
    const left: Object3D[] = []; // what glTF has no words for
    copy.traverse((one) => {
      if (one instanceof Mesh) one.material = new MeshStandardMaterial({ color: one.material.color, opacity: one.material.opacity, transparent: one.material.transparent });
      else if (one instanceof Light || one instanceof Line || one instanceof Points) left.push(one);
    });
    for (const one of left) one.removeFromParent();
    return new Blob([(await new GLTFExporter().parseAsync(copy, { binary: true })) as ArrayBuffer], { type: "model/gltf-binary" });
  }

  recolour(): void {
    this.scene.background = new Color(colour("stage"));
    this.draw();
  }

  // In motion coarse until pictures prove fast, as with a graphics card; at rest twice as sharp as the screen.
  private draw(atRest = false): void {
    clearTimeout(this.settling);
    if (!atRest) this.settling = setTimeout(() => this.draw(true), 250);
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => {
      this.waiting = false;
      const took = now - this.before;
      this.before = now;
      if (!atRest && took < 5 * SLOW) this.balance += took < FAST ? 1 : took > SLOW ? -1 : 0;
      if (this.balance > ENOUGH && this.moving === COARSE) [this.moving, this.balance] = [Math.min(1, devicePixelRatio), 0];
      if (this.balance < -ENOUGH && this.moving > COARSE) [this.moving, this.balance] = [COARSE, Number.NEGATIVE_INFINITY]; // once and for all
      const ratio = atRest ? 2 * devicePixelRatio : this.moving;
      if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
      this.renderer.render(this.scene, this.camera);
      this.drawn++;
    });
  }

  private cut(wheel: Wheel): Plane {
    const contact = matrix(wheel.T_base_contact0);
    const through = new Vector3().setFromMatrixPosition(contact);
    if (this.dot.visible) through.lerp(this.dot.position, 0.98); // a hair inside, where the point is at the edge of the wheel
    return new Plane().setFromNormalAndCoplanarPoint(new Vector3().setFromMatrixColumn(contact, 0).negate(), through);
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private add(solid: Solid): void {
    const indexed = new BufferGeometry().setAttribute("position", new BufferAttribute(this.block.array(solid.vertices), 3));
    const geometry = indexed.setIndex([...this.block.array(solid.faces)]).toNonIndexed(); // so that faces are flat
    geometry.computeVertexNormals();
    const opacity = solid.around ? 0.35 : 1;
    const material = new MeshLambertMaterial({ color: solid.colour, side: DoubleSide, transparent: solid.around, opacity, depthWrite: !solid.around, forceSinglePass: true, polygonOffset: solid.around, polygonOffsetFactor: 4 });
    const mesh = placed(new Mesh(geometry, material), matrix(solid.T));
    mesh.userData = { colour: solid.colour, opacity };
    mesh.name = solid.name;
    mesh.add(new LineSegments(new EdgesGeometry(geometry, 25), new LineBasicMaterial({ color: 0x22303c, transparent: true, opacity: 0.4 })));
    (this.joints[solid.joint - 1] ?? this.scene).add(mesh);
    this.bodies.set(solid.name, [...(this.bodies.get(solid.name) ?? []), mesh]);
  }

  private addPasses(points: NonNullable<Page["points"]>): void {
    const places = (packed: Packed) => new BufferAttribute(this.block.array(packed).slice(), 3);
    const pass = this.block.array(points.pass);
    const [faces, strokes]: number[][] = [[], []];
    for (let k = 0; k < pass.length; k++) {
      this.ends.push(strokes.length);
      if (pass[k] !== pass[k + 1]) continue;
      faces.push(2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 1, 2 * k + 3, 2 * k + 2);
      strokes.push(k, k + 1);
    }
    const band = new BufferGeometry().setAttribute("position", places(points.edges)).setIndex(faces);
    this.ribbon = new Mesh(band, new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -2 }));
    const line = new BufferGeometry().setAttribute("position", places(points.line)).setIndex(strokes);
    this.trace = new LineSegments(line, new LineBasicMaterial({ color: RED }));
    const triads = new BufferGeometry().setAttribute("position", places(points.triads));
    const hues = [[0.78, 0.06, 0.18], [0.18, 0.49, 0.2], [0.04, 0.31, 0.54]]; // all x axes, then y, then z
    const count = triads.getAttribute("position").count;
    const hue = (_: unknown, k: number) => linear(hues[Math.floor(k / count)][k % 3]);
    triads.setAttribute("color", new BufferAttribute(Float32Array.from({ length: 3 * count }, hue), 3));
    this.frames = new LineSegments(triads, new LineBasicMaterial({ vertexColors: true }));
    this.ribbon.visible = this.frames.visible = false;
    const bare = new BufferGeometry().setAttribute("position", places(points.missed));
    const missed = new Points(bare, new PointsMaterial({ color: 0xe08214, size: 3, sizeAttenuation: false }));
    const onPart = placed(new Group(), this.bodies.get("part")?.[0].matrix ?? new Matrix4());
    (this.joints.at(-1) ?? this.scene).add(onPart.add(this.ribbon, this.trace, this.frames, missed));
  }
}

// A part of a colour as light, which is what colours of corners are given in.
const linear = (part: number): number => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4);

function placed<T extends Group | Mesh>(object: T, pose: Matrix4): T {
  object.matrixAutoUpdate = false;
  object.matrix.copy(pose);
  return object;
}
