// The court in three dimensions. Drawn when something has changed, never in between: it is a phone.
import * as three from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Ball, Court, Target, Xyz } from "../contract";
import { ellipse95 } from "../pure/ellipse";
import { drawnFrom } from "../pure/trajectory";
import { RADII_M, courtFrom, disc, dispose, fatLine, onTop, ring, shadowOf, tube, type Palette } from "./meshes";

export type Place = "behind" | "above" | "side" | "landing";

export interface Content {
  ball: Ball | null;
  others: Ball[];
  target: Target | null;
}

const FIELD_DEG = 38;
const MARK_PX = 34;
const FLIGHT_MS = 650;
const TURN_MS = 380;
const MID_Y_M = 11.885;

export class Scene {
  private readonly renderer: three.WebGLRenderer;
  private readonly scene = new three.Scene();
  private readonly camera = new three.PerspectiveCamera(FIELD_DEG, 1, 0.05, 250);
  private readonly controls: OrbitControls;
  private readonly observer: ResizeObserver;
  private ground: three.Group | null = null;
  private balls: three.Group | null = null;
  private mark: three.Sprite | null = null;
  private content: Content = { ball: null, others: [], target: null };
  private shown_id: number | null = null;
  private place: Place = "behind";
  private is_free = false;
  private frame = 0;
  private steps: ((now: number) => boolean)[] = [];

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private court: Court,
    private palette: Palette,
    private readonly isStill: () => boolean,
  ) {
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true });
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.camera.up.set(0, 0, 1);
    this.scene.add(new three.HemisphereLight(0xffffff, 0x8899aa, 2.4));
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 1.53;
    this.controls.minDistance = 0.4;
    this.controls.maxDistance = 80;
    this.controls.touches = { ONE: three.TOUCH.ROTATE, TWO: three.TOUCH.DOLLY_PAN };
    // One finger up or down scrolls the page; the court must not hold a phone fast.
    canvas.style.touchAction = "pan-y";
    this.controls.addEventListener("start", () => {
      this.is_free = true;
      this.steps = [];
    });
    this.controls.addEventListener("change", () => this.ask());
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement ?? canvas);
    this.paint(palette);
    this.resize();
  }

  paint(palette: Palette): void {
    this.palette = palette;
    this.scene.background = new three.Color(palette.air);
    if (this.ground) {
      this.scene.remove(this.ground);
      dispose(this.ground);
    }
    this.ground = courtFrom(this.court, palette);
    this.scene.add(this.ground);
    this.show(this.content);
  }

  show(content: Content): void {
    const is_new = content.ball !== null && content.ball.id !== this.shown_id;
    const is_first = this.shown_id === null;
    this.content = content;
    this.shown_id = content.ball?.id ?? null;
    if (this.balls) {
      this.scene.remove(this.balls);
      dispose(this.balls);
    }
    this.balls = new three.Group();
    this.scene.add(this.balls);
    content.others.forEach((ball, i) => this.addOld(ball, 0.5 * (1 - i / content.others.length)));
    if (content.target) this.addTarget(content.target);
    const flight = content.ball ? this.addBall(content.ball) : null;
    if (is_new && !is_first && flight && !this.isStill()) this.grow(flight);
    if (this.place === "landing" && !this.is_free && is_new) this.look("landing", false);
    this.ask();
  }

  private get radii() {
    return this.place === "landing" ? RADII_M.near : RADII_M.far;
  }

  private addOld(ball: Ball, opacity: number): void {
    const { before } = drawnFrom(ball.shot);
    if (before.length > 1) this.balls?.add(tube(before, this.palette.old, opacity, true, this.radii.old));
  }

  private addTarget(target: Target): void {
    const r = target.zone_radius_m;
    const zone = { center_m: target.landing_m, half_axes_m: [r, r] as [number, number], turned_rad: 0 };
    this.balls?.add(disc(zone, this.palette.target, 0.22, 3, 2.5));
    const [x, y] = target.landing_m;
    const arm = Math.min(0.25, r / 2);
    for (const [dx, dy] of [[arm, 0], [0, arm]] as const) {
      const cross: Xyz[] = [[x - dx, y - dy, 0.016], [x + dx, y + dy, 0.016]];
      this.balls?.add(fatLine(cross, this.palette.target, 2.5, null));
    }
  }

  private addBall(ball: Ball): three.Mesh | null {
    const { before, after } = drawnFrom(ball.shot);
    const { palette, balls } = this;
    if (ball.reference_m && ball.reference_m.length > 1) {
      balls?.add(fatLine(ball.reference_m, palette.reference, 3, 0.45));
    }
    let flight: three.Mesh | null = null;
    if (before.length > 1) {
      const opacity = this.place === "landing" ? 0.45 : 1;
      flight = tube(before, palette.ball, opacity, false, this.radii.ball);
      balls?.add(flight, shadowOf(before, palette.shadow));
    }
    if (after.length > 1) balls?.add(tube(after, palette.ball, 0.5, true, this.radii.old));
    const bounce = ball.shot.bounce;
    if (bounce) {
      const [x, y] = bounce.position_m;
      const ellipse = ellipse95([x, y], bounce.covariance_m2);
      if (ellipse) balls?.add(onTop(disc(ellipse, palette.ball, 0.6, 5, 2.5)));
      if (this.place === "landing") {
        const [tx, ty] = this.content.target?.landing_m ?? [x, y];
        if (tx !== x || ty !== y) {
          balls?.add(fatLine([[tx, ty, 0.018], [x, y, 0.018]], palette.reference, 2.5, null));
        }
      } else {
        this.mark = ring([x, y, 0.02], palette.ball);
        this.sizeMark();
        balls?.add(this.mark);
      }
    }
    return flight;
  }

  private sizeMark(): void {
    const height_px = this.canvas.clientHeight;
    const half = Math.tan((FIELD_DEG * Math.PI) / 360);
    if (height_px > 0) this.mark?.scale.setScalar((MARK_PX * 2 * half) / height_px);
  }

  private grow(flight: three.Mesh): void {
    const total = flight.geometry.index?.count ?? 0;
    const began = performance.now();
    flight.geometry.setDrawRange(0, 0);
    this.steps.push((now) => {
      const part = Math.min(1, (now - began) / FLIGHT_MS);
      flight.geometry.setDrawRange(0, Math.ceil((total * part) / 6) * 6);
      return part < 1;
    });
  }

  look(place: Place, is_asked = true): void {
    const is_other_size = (place === "landing") !== (this.place === "landing");
    this.place = place;
    if (is_other_size) this.show(this.content);
    if (is_asked) this.is_free = false;
    const [from, to] = this.stand(place);
    if (this.isStill() || !is_asked) {
      this.camera.position.copy(from);
      this.controls.target.copy(to);
      this.controls.update();
      return this.ask();
    }
    const [from_0, to_0] = [this.camera.position.clone(), this.controls.target.clone()];
    const began = performance.now();
    this.steps.push((now) => {
      const part = Math.min(1, (now - began) / TURN_MS);
      const eased = part * part * (3 - 2 * part);
      this.camera.position.lerpVectors(from_0, from, eased);
      this.controls.target.lerpVectors(to_0, to, eased);
      this.controls.update();
      return part < 1;
    });
    this.ask();
  }

  /** From where the court fits into the picture, whatever its form. */
  private stand(place: Place): [three.Vector3, three.Vector3] {
    const half = Math.tan((FIELD_DEG * Math.PI) / 360);
    const wide = half * this.camera.aspect;
    const at = (x: number, y: number, z: number) => new three.Vector3(x, y, z);
    switch (place) {
      case "behind": {
        // Near enough that the far half is large; what is cut off is the near one.
        const far = Math.max(5.6, 3.4 / wide);
        return [at(0, 1.5 - far, 2.6 + 0.7 * far), at(0, 13.2, 0)];
      }
      case "above": {
        // A low picture shows the half where balls land, a high one all of the court.
        const [mid, reach] = this.canvas.clientHeight < 420 ? [16.4, 8.9] : [MID_Y_M - 0.9, 14.6];
        const high = Math.max(reach / half, 7.2 / wide);
        return [at(0, mid - 0.02, high), at(0, mid, 0)];
      }
      case "side": {
        const far = Math.max(14.2 / wide, 8);
        return [at(far, MID_Y_M, 1.4 + 0.1 * far), at(0, MID_Y_M, 1.2)];
      }
      case "landing": {
        const { ball, target } = this.content;
        const landing = ball?.shot.bounce?.position_m ?? null;
        const aim = target?.landing_m ?? null;
        const [bx, by] = landing ?? aim ?? [0, 18];
        const [tx, ty] = aim ?? [bx, by];
        const reach = Math.max(0.35, Math.hypot(bx - tx, by - ty) * 0.62);
        const far = reach / Math.min(half, wide);
        const [x, y] = [(bx + tx) / 2, (by + ty) / 2];
        return [at(x, y - 0.45 * far, 0.95 * far), at(x, y - 0.1 * reach, 0)];
      }
    }
  }

  private resize(): void {
    const box = (this.canvas.parentElement ?? this.canvas).getBoundingClientRect();
    if (box.width < 1 || box.height < 1) return;
    this.renderer.setSize(box.width, box.height, false);
    this.camera.aspect = box.width / box.height;
    this.camera.updateProjectionMatrix();
    this.sizeMark();
    if (this.is_free) this.ask();
    else this.look(this.place, false);
  }

  /** One picture at the next frame, however often it is asked for. */
  private ask(): void {
    if (this.frame !== 0) return;
    this.frame = requestAnimationFrame((now) => {
      this.frame = 0;
      this.steps = this.steps.filter((step) => step(now));
      this.renderer.render(this.scene, this.camera);
      const is_done = this.steps.length === 0;
      this.canvas.dataset["drawn"] = is_done ? `${this.shown_id ?? "court"}` : "moving";
      if (this.steps.length > 0) this.ask();
    });
  }

  dispose(): void {
    cancelAnimationFrame(this.frame);
    this.observer.disconnect();
    this.controls.dispose();
    for (const group of [this.ground, this.balls]) if (group) dispose(group);
    this.renderer.dispose();
  }
}
