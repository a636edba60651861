// What stands on the court, as meshes in the court frame (x right, y far, z up), true to scale.
import * as three from "three";
import { Line2 } from "three/addons/lines/Line2.js";
import { LineGeometry } from "three/addons/lines/LineGeometry.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import type { Court, Ellipse, Xy, Xyz } from "../contract";
import { pointsOfEllipse } from "../pure/ellipse";
import { cordHeight } from "../pure/trajectory";

export interface Palette {
  air: string;
  around: string;
  outside: string;
  inside: string;
  line: string;
  ball: string;
  old: string;
  reference: string;
  target: string;
  net: string;
  machine: string;
  shadow: string;
}

const LINE_WIDTH_M = 0.06;
/** Thicker than a ball, or a phone would not show it; near its bounce thinner than its ellipse. */
export const RADII_M = { far: { ball: 0.055, old: 0.03 }, near: { ball: 0.006, old: 0.003 } } as const;
/** Painted things lie a little above each other, or they would flicker. */
const LAYER_M = 0.004;

/**
 * Nothing is ever below the ground, so it is painted first, layer by layer, without a look at
 * depths: at thirty metres those of two layers are the same number.
 */
const GROUND = { depthTest: false, depthWrite: false };

function flat(width_m: number, length_m: number, colour: string, layer: number, at: Xy) {
  const mesh = new three.Mesh(
    new three.PlaneGeometry(width_m, length_m),
    new three.MeshBasicMaterial({ color: colour, ...GROUND }),
  );
  mesh.renderOrder = -10 + layer;
  mesh.position.set(at[0], at[1], layer * LAYER_M);
  return mesh;
}

function painted(a: Xy, b: Xy, colour: string) {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const mid: Xy = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const length_m = Math.hypot(dx, dy) + LINE_WIDTH_M;
  const line = flat(LINE_WIDTH_M, length_m, colour, 2, mid);
  line.rotation.z = Math.atan2(dy, dx) - Math.PI / 2;
  return line;
}

const AROUND_M = 70;

/** What lies around the court fades into the air, so that there is no edge of the world. */
function surroundings(palette: Palette) {
  const geometry = new three.CircleGeometry(AROUND_M, 64);
  const n = geometry.getAttribute("position").count;
  const [middle, rim] = [new three.Color(palette.around), new three.Color(palette.air)];
  const colours = Array.from({ length: n }, (_, i) => (i === 0 ? middle : rim).toArray()).flat();
  geometry.setAttribute("color", new three.Float32BufferAttribute(colours, 3));
  const mesh = new three.Mesh(geometry, new three.MeshBasicMaterial({ vertexColors: true, ...GROUND }));
  mesh.renderOrder = -11;
  mesh.position.set(0, 12, -0.02);
  return mesh;
}

const NET_COLUMNS = 32;
const TAPE_M = 0.06;

function strip(xs: number[], low: (x: number) => number, high: (x: number) => number, y_m: number) {
  const places = xs.flatMap((x) => [x, y_m, low(x), x, y_m, high(x)]);
  const faces = xs.slice(1).flatMap((_, i) => {
    const k = 2 * i;
    return [k, k + 2, k + 1, k + 1, k + 2, k + 3];
  });
  const geometry = new three.BufferGeometry();
  geometry.setAttribute("position", new three.Float32BufferAttribute(places, 3));
  geometry.setIndex(faces);
  return geometry;
}

function net(court: Court, palette: Palette): three.Object3D {
  const { net } = court;
  const [left, right] = net.posts_x_m;
  const xs = Array.from(
    { length: NET_COLUMNS + 1 },
    (_, i) => left + ((right - left) * i) / NET_COLUMNS,
  );
  const cord = (x: number) => cordHeight(x, net);
  const group = new three.Group();
  const side = three.DoubleSide;
  const mesh = new three.MeshBasicMaterial({
    color: palette.net, transparent: true, opacity: 0.42, side, depthWrite: false,
  });
  group.add(new three.Mesh(strip(xs, () => 0, cord, net.y_m), mesh));
  const tape = new three.MeshBasicMaterial({ color: palette.line, side });
  group.add(new three.Mesh(strip(xs, (x) => cord(x) - TAPE_M, cord, net.y_m - 0.01), tape));
  for (const x of [left, right]) {
    const post = new three.Mesh(
      new three.CylinderGeometry(0.045, 0.045, net.height_post_m, 12),
      new three.MeshBasicMaterial({ color: palette.net }),
    );
    post.rotation.x = Math.PI / 2;
    post.position.set(x, net.y_m, net.height_post_m / 2);
    group.add(post);
  }
  return group;
}

export function courtFrom(court: Court, palette: Palette): three.Group {
  const group = new three.Group();
  const length_m = 2 * court.net.y_m;
  const mid: Xy = [0, court.net.y_m];
  group.add(surroundings(palette), flat(19, length_m + 13, palette.outside, 0, mid));
  group.add(flat(10.97, length_m, palette.inside, 1, mid));
  for (const [a, b] of court.lines_m) group.add(painted(a, b, palette.line));
  const [post, other] = court.net.posts_x_m;
  group.add(flat(other - post, 0.1, palette.net, 3, [(post + other) / 2, court.net.y_m]));
  group.add(net(court, palette));
  if (court.launcher_m) {
    const [x, y, z] = court.launcher_m;
    const box = new three.Mesh(
      new three.BoxGeometry(0.5, 0.6, z),
      new three.MeshLambertMaterial({ color: palette.machine }),
    );
    box.position.set(x, y - 0.35, z / 2);
    group.add(box);
  }
  for (const [x, y, z] of court.cameras_m) {
    const box = new three.Mesh(
      new three.BoxGeometry(0.22, 0.3, 0.22),
      new three.MeshLambertMaterial({ color: palette.machine }),
    );
    box.position.set(x, y, z);
    const mast = new three.Mesh(
      new three.CylinderGeometry(0.03, 0.03, z, 8),
      new three.MeshLambertMaterial({ color: palette.machine }),
    );
    mast.rotation.x = Math.PI / 2;
    mast.position.set(x, y, z / 2);
    group.add(box, mast);
  }
  return group;
}

const vector = ([x, y, z]: Xyz) => new three.Vector3(x, y, z);

/** The points are those of the track; between them a smooth curve. */
export function tube(
  points: Xyz[], colour: string, opacity: number, is_old: boolean, radius: number,
) {
  const curve = new three.CatmullRomCurve3(points.map(vector), false, "centripetal");
  const n = Math.min(160, Math.max(24, points.length * 2));
  const geometry = new three.TubeGeometry(curve, n, radius, 8, false);
  const material = is_old
    ? new three.MeshBasicMaterial({ color: colour, transparent: true, opacity, depthWrite: false })
    : new three.MeshLambertMaterial({
        color: colour, emissive: colour, emissiveIntensity: 0.55,
        transparent: opacity < 1, opacity,
      });
  return new three.Mesh(geometry, material);
}

export function fatLine(points: Xyz[], colour: string, width_px: number, dash_m: number | null) {
  const geometry = new LineGeometry();
  geometry.setPositions(points.flat());
  const material = new LineMaterial({
    color: new three.Color(colour).getHex(),
    linewidth: width_px,
    dashed: dash_m !== null,
    dashSize: dash_m ?? 1,
    gapSize: dash_m === null ? 0 : dash_m * 0.8,
    transparent: true,
  });
  const line = new Line2(geometry, material);
  line.computeLineDistances();
  return line;
}

function raised(points: Xy[], z_m: number): Xyz[] {
  const first = points[0] as Xy;
  return [...points, first].map(([x, y]): Xyz => [x, y, z_m]);
}

export function disc(ellipse: Ellipse, colour: string, opacity: number, layer: number, edge_px: number) {
  const points = pointsOfEllipse(ellipse, 72);
  const group = new three.Group();
  const shape = new three.Shape(points.map(([x, y]) => new three.Vector2(x, y)));
  const fill = new three.Mesh(
    new three.ShapeGeometry(shape),
    new three.MeshBasicMaterial({
      color: colour, transparent: true, opacity, depthWrite: false, side: three.DoubleSide,
    }),
  );
  fill.position.z = layer * LAYER_M;
  group.add(fill, fatLine(raised(points, (layer + 0.5) * LAYER_M), colour, edge_px, null));
  return group;
}

export function shadowOf(points: Xyz[], colour: string) {
  const line = fatLine(points.map(([x, y]): Xyz => [x, y, 3.5 * LAYER_M]), colour, 3, null);
  line.material.opacity = 0.35;
  return line;
}

/** A ring of the same size at any distance: where a bounce is that is centimetres big. */
export function ring(at: Xyz, colour: string): three.Sprite {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const pen = canvas.getContext("2d");
  if (pen) {
    pen.lineWidth = 7;
    pen.strokeStyle = "rgba(0,0,0,0.55)";
    pen.arc(32, 32, 24, 0, 2 * Math.PI);
    pen.stroke();
    pen.lineWidth = 4.5;
    pen.strokeStyle = colour;
    pen.stroke();
  }
  const texture = new three.CanvasTexture(canvas);
  texture.colorSpace = three.SRGBColorSpace;
  const sprite = new three.Sprite(
    new three.SpriteMaterial({ map: texture, sizeAttenuation: false, depthTest: false }),
  );
  sprite.position.set(...at);
  return sprite;
}

/** Drawn last and through whatever stands before it. */
export function onTop(group: three.Group): three.Group {
  for (const one of group.children) {
    one.renderOrder = 5;
    const { material } = one as three.Mesh;
    for (const each of Array.isArray(material) ? material : [material]) each.depthTest = false;
  }
  return group;
}

export function dispose(root: three.Object3D): void {
  root.traverse((one) => {
    const { geometry, material } = one as Partial<three.Mesh>;
    geometry?.dispose();
    for (const each of Array.isArray(material) ? material : [material]) {
      if (each instanceof three.SpriteMaterial) each.map?.dispose();
      each?.dispose();
    }
  });
}
