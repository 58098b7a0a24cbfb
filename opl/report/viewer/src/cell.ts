// The cell in three dimensions: posed, looked at from somewhere, cut open, coloured.

import {
  AmbientLight, BoxGeometry, BufferAttribute, BufferGeometry, Color, CylinderGeometry, DirectionalLight, DoubleSide,
  EdgesGeometry, FrontSide, Group, Line, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, PerspectiveCamera, Plane, Points, PointsMaterial, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { type Block, colour, type Packed, type Page, type Solid } from "./data";

export const matrix = (T: ArrayLike<number>): Matrix4 =>
  new Matrix4().set(T[0], T[1], T[2], T[3], T[4], T[5], T[6], T[7], T[8], T[9], T[10], T[11], 0, 0, 0, 1);

// The contact frame at contact position t: slid along x on the flat, rolled about y at the edges.
export function contactFrame(wheel: NonNullable<Page["wheel"]>, t: number): Matrix4 {
  const slide = Math.max(-wheel.flat_end, Math.min(wheel.flat_end, t));
  const roll = ((t - slide) * Math.PI) / 180;
  return matrix(wheel.T_base_contact0).multiply(new Matrix4().makeRotationY(roll).setPosition(-slide / 1000, 0, 0));
}

export class CellView {
  readonly camera = new PerspectiveCamera(35, 1, 0.01, 50);
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly controls: OrbitControls;
  private readonly joints: Group[] = [];
  private readonly rest: Matrix4[];
  private readonly axes: Vector3[];
  private readonly bodies = new Map<string, Mesh<BufferGeometry, MeshLambertMaterial>[]>();
  private readonly onPart = new Group(); // in the workpiece frame
  private readonly dot: Mesh;
  private readonly nearest: Line;
  private readonly T_joint_part: Matrix4;
  private ghost: Group | null = null;
  private ribbon: Mesh<BufferGeometry, MeshBasicMaterial> | null = null;
  private trace: Line | null = null;
  private frames: LineSegments | null = null;
  private red: string[] = [];
  private waiting = false;
  drawn = 0; // pictures made up to now

  constructor(private readonly canvas: HTMLCanvasElement, private readonly page: Page, private readonly block: Block) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.camera.up.set(0, 0, 1);
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    for (const [x, y, z, much] of [[2, -3, 4, 2.2], [-3, 2, 1, 0.8]]) {
      const light = new DirectionalLight(0xffffff, much);
      light.position.set(x, y, z);
      this.scene.add(light);
    }
    this.rest = page.cell.joints.map((joint) => matrix(joint.T));
    this.axes = page.cell.joints.map((joint) => new Vector3(...joint.axis));
    let parent: Scene | Group = this.scene;
    for (const T of this.rest) {
      const group = new Group();
      group.matrixAutoUpdate = false;
      group.matrix.copy(T);
      parent.add(group);
      this.joints.push(group);
      parent = group;
    }
    for (const solid of page.cell.solids) this.add(solid);
    const part = page.cell.solids.find((solid) => solid.name === "part");
    this.T_joint_part = matrix(part?.T ?? page.cell.flange);
    place(this.onPart, this.T_joint_part);
    (this.joints.at(-1) ?? this.scene).add(this.onPart);
    this.dot = new Mesh(new SphereGeometry(0.003, 16, 12), new MeshBasicMaterial({ color: 0xd00000, depthTest: false }));
    this.dot.renderOrder = 3;
    this.nearest = new Line(new BufferGeometry(), new LineBasicMaterial({ color: 0xd00000, depthTest: false }));
    this.nearest.renderOrder = 3;
    this.dot.visible = this.nearest.visible = false;
    this.scene.add(this.dot, this.nearest);
    if (page.points !== null) this.addPasses(page.points);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.listenToKeyEvents(canvas);
    this.controls.keyPanSpeed = 20;
    this.controls.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.recolour();
    this.fit();
    this.look("cell");
  }

  // Turn the joints; without angles the arm stays where it is.
  pose(q: ArrayLike<number>): void {
    this.joints.forEach((joint, k) => {
      joint.matrix.copy(this.rest[k]).multiply(new Matrix4().makeRotationAxis(this.axes[k], q[k]));
      joint.matrixWorldNeedsUpdate = true;
    });
    this.draw();
  }

  // Pose of the flange in the base frame, row by row, as posed.
  flange(): number[] {
    this.scene.updateMatrixWorld();
    const last = this.joints.at(-1)?.matrixWorld ?? new Matrix4();
    return last.clone().multiply(matrix(this.page.cell.flange)).transpose().elements;
  }

  // Show what is held where no arm can bring it; null takes it away. T_base_workpiece.
  phantom(T: Matrix4 | null): void {
    if (this.ghost !== null) this.scene.remove(this.ghost);
    this.ghost = null;
    if (T !== null) {
      this.ghost = new Group();
      const pale = new MeshLambertMaterial({ color: 0x8a5f9e, transparent: true, opacity: 0.55 });
      for (const mesh of this.bodies.get("part") ?? []) this.ghost.add(new Mesh(mesh.geometry, pale));
      place(this.ghost, T);
      this.scene.add(this.ghost);
    }
    this.draw();
  }

  contact(t: number | null): void {
    this.dot.visible = t !== null && this.page.wheel !== null;
    if (t !== null && this.page.wheel !== null) this.dot.position.setFromMatrixPosition(contactFrame(this.page.wheel, t));
  }

  line(ends: ArrayLike<number> | null): void {
    this.nearest.visible = ends !== null;
    if (ends !== null) {
      this.nearest.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(ends), 3));
    }
  }

  // Bodies that collide get red, with their edges drawn, so that they are seen without colour too.
  mark(names: string[]): void {
    for (const name of this.red) this.paint(name, false);
    this.red = names;
    for (const name of names) this.paint(name, true);
    this.draw();
  }

  ground(upTo: number): void {
    this.trace?.geometry.setDrawRange(0, Math.max(0, Math.floor(upTo) + 1));
  }

  // Colours along the passes, three numbers a cutter point; null hides them.
  colourPasses(colours: Float32Array | null): void {
    if (this.ribbon === null || this.page.points === null) return;
    this.ribbon.visible = colours !== null;
    if (colours !== null) {
      const both = new Float32Array(colours.length * 2);
      for (let k = 0; k < colours.length / 3; k++) {
        both.set(colours.subarray(3 * k, 3 * k + 3), 6 * k);
        both.set(colours.subarray(3 * k, 3 * k + 3), 6 * k + 3);
      }
      this.ribbon.geometry.setAttribute("color", new BufferAttribute(both, 3));
    }
    this.draw();
  }

  show(what: "section" | "frames" | "surroundings", on: boolean): void {
    if (what === "frames" && this.frames !== null) this.frames.visible = on;
    if (what === "surroundings") {
      for (const solid of this.page.cell.solids) {
        if (solid.joint > 0 || solid.robot || solid.name === "wheel") continue;
        for (const mesh of this.bodies.get(solid.name) ?? []) mesh.visible = on;
      }
    }
    if (what === "section") {
      this.renderer.clippingPlanes = on && this.page.wheel !== null ? [this.cut(this.page.wheel)] : [];
    }
    this.draw();
  }

  look(from: string): void {
    const centre = new Vector3();
    let away = new Vector3(1.9, -2.4, 1.3);
    const wheel = this.page.wheel;
    if (wheel !== null) {
      const contact = matrix(wheel.T_base_contact0);
      centre.setFromMatrixPosition(contact);
      const [x, y, z] = [0, 1, 2].map((k) => new Vector3().setFromMatrixColumn(contact, k));
      const near = 4 * Math.max(wheel.radius, wheel.width);
      if (from === "contact") away = z.clone().multiplyScalar(-0.8 * near).addScaledVector(x, 0.5 * near).addScaledVector(y, 0.35 * near);
      if (from === "axle") away = x.clone().multiplyScalar(1.3 * near);
      if (from === "top") away = new Vector3(0, -0.001, 3.2);
      if (from === "cell") centre.multiplyScalar(0.5).add(new Vector3(0, 0, 0.25));
    }
    const part = this.page.cell.joints.length === 0 ? this.size() : null;
    if (part !== null) {
      away.setLength(3.2 * part.radius);
      centre.copy(part.centre);
    } else if (from === "cell" || from === "top") away.multiplyScalar(0.9 + 0.35 / Math.max(0.4, this.camera.aspect));
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).add(away);
    this.controls.update();
    this.draw();
  }

  recolour(): void {
    this.scene.background = new Color(colour("stage"));
    this.draw();
  }

  draw(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.renderer.render(this.scene, this.camera);
      this.drawn++;
    });
  }

  private size(): { centre: Vector3; radius: number } {
    const geometry = this.bodies.get("part")?.[0]?.geometry;
    geometry?.computeBoundingSphere();
    const sphere = geometry?.boundingSphere;
    return { centre: sphere?.center.clone() ?? new Vector3(), radius: sphere?.radius ?? 1 };
  }

  private cut(wheel: NonNullable<Page["wheel"]>): Plane {
    const contact = matrix(wheel.T_base_contact0);
    const normal = new Vector3().setFromMatrixColumn(contact, 0).negate();
    const through = this.dot.visible ? this.dot.position : new Vector3().setFromMatrixPosition(contact);
    return new Plane().setFromNormalAndCoplanarPoint(normal, through);
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private add(solid: Solid): void {
    const geometry = this.geometry(solid);
    const around = solid.joint === 0 && !solid.robot && solid.name !== "wheel";
    const material = new MeshLambertMaterial({
      color: this.paintOf(solid),
      side: solid.kind === "mesh" ? DoubleSide : FrontSide,
      transparent: around,
      opacity: around ? 0.35 : 1,
      depthWrite: !around,
    });
    const mesh = new Mesh(geometry, material);
    mesh.userData = { colour: this.paintOf(solid), opacity: material.opacity };
    mesh.add(new LineSegments(new EdgesGeometry(geometry, 25), new LineBasicMaterial({ color: 0x22303c, transparent: true, opacity: 0.4 })));
    place(mesh, matrix(solid.T));
    if (solid.kind === "cylinder") mesh.matrix.multiply(new Matrix4().makeRotationX(Math.PI / 2)); // three's stand along y
    (solid.joint === 0 ? this.scene : this.joints[solid.joint - 1] ?? this.scene).add(mesh);
    this.bodies.set(solid.name, [...(this.bodies.get(solid.name) ?? []), mesh]);
  }

  private geometry(solid: Solid): BufferGeometry {
    const [a, b, c] = solid.size ?? [];
    if (solid.kind === "box") return new BoxGeometry(a, b, c);
    if (solid.kind === "cylinder") return new CylinderGeometry(a, a, b, a > 0.08 ? 96 : 32);
    const geometry = new BufferGeometry();
    if (solid.vertices !== undefined && solid.faces !== undefined) {
      const columns = this.block.array(solid.vertices);
      const count = columns.length / 3;
      const corners = new Float32Array(columns.length);
      for (let k = 0; k < columns.length; k++) corners[3 * (k % count) + Math.floor(k / count)] = columns[k];
      geometry.setAttribute("position", new BufferAttribute(corners, 3));
      geometry.setIndex([...this.block.array(solid.faces)]);
    }
    const flat = geometry.toNonIndexed();
    flat.computeVertexNormals();
    return flat;
  }

  private paintOf(solid: Solid): number {
    if (solid.name === "wheel") return 0x6b5b4b;
    if (solid.robot) return solid.joint % 2 ? 0xe6a13c : 0xd2d7db;
    if (solid.name === "part") return 0x9fb4c4;
    return solid.joint > 0 ? 0x5b6670 : 0x8fa0ad;
  }

  private paint(name: string, red: boolean): void {
    for (const mesh of this.bodies.get(name) ?? []) {
      mesh.material.color.set(red ? 0xd03030 : mesh.userData.colour);
      mesh.material.opacity = red ? Math.max(0.6, mesh.userData.opacity) : mesh.userData.opacity;
      const edges = (mesh.children[0] as LineSegments).material as LineBasicMaterial;
      edges.opacity = red ? 1 : 0.4;
    }
  }

  private addPasses(points: NonNullable<Page["points"]>): void {
    const places = (packed: Packed) => new BufferAttribute(this.block.array(packed).slice(), 3);
    const pass = this.block.array(points.pass);
    const faces: number[] = [];
    for (let k = 0; k + 1 < pass.length; k++) {
      if (pass[k] === pass[k + 1]) faces.push(2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 1, 2 * k + 3, 2 * k + 2);
    }
    const band = new BufferGeometry().setAttribute("position", places(points.edges)).setIndex(faces);
    this.ribbon = new Mesh(band, new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -2 }));
    this.ribbon.visible = false;
    this.trace = new Line(new BufferGeometry().setAttribute("position", places(points.line)), new LineBasicMaterial({ color: 0xd00000 }));
    const triads = new BufferGeometry().setAttribute("position", places(points.triads));
    const hues = [[0.78, 0.06, 0.18], [0.18, 0.49, 0.2], [0.04, 0.31, 0.54]]; // x, y, z one after the other
    const count = triads.getAttribute("position").count;
    triads.setAttribute("color", new BufferAttribute(Float32Array.from({ length: 3 * count }, (_, k) => hues[Math.floor(k / count)][k % 3]), 3));
    this.frames = new LineSegments(triads, new LineBasicMaterial({ vertexColors: true }));
    this.frames.visible = false;
    const bare = new BufferGeometry().setAttribute("position", places(points.missed));
    this.onPart.add(this.ribbon, this.trace, this.frames, new Points(bare, new PointsMaterial({ color: 0xe08214, size: 3, sizeAttenuation: false })));
  }
}

function place(object: Group | Mesh, T: Matrix4): void {
  object.matrixAutoUpdate = false;
  object.matrix.copy(T);
}
