// A hand made of a skeleton document (format glovecal.skeleton.v1, GET /v1/subjects/{name}/skeleton).
//
// Every joint is a three.js object below its parent: offset, orientation, and a turn about its own axis by the
// weighted sum of its rotations; three.js multiplies the frames. The same as forward_kinematics in Python.
import { THREE } from "nicegui-scene";

const RADIANS = Math.PI / 180;
const BONE_MM = 5.5;
const JOINT_MM = 7.5;
const FIELD_DEG = 28;
const GAP = 0xdc2626;
const GAP_MM = 2;
const LEAST_GAP_MM = 0.05; // shorter, it has no direction

/** Angles of every rotation of the hand: what is given, else its rule, else its rest. */
export function completed(skeleton, given) {
  const angles = {};
  for (const rotation of skeleton.rotations) {
    const value = given[rotation.name];
    angles[rotation.name] = Number.isFinite(value) ? value : null;
  }
  for (const rotation of skeleton.rotations) {
    if (angles[rotation.name] !== null) continue;
    if (rotation.rule === null) {
      angles[rotation.name] = rotation.rest;
    }
  }
  for (const rotation of skeleton.rotations) {
    if (angles[rotation.name] !== null) continue;
    let sum = 0;
    for (const [name, weight] of Object.entries(rotation.rule)) sum += weight * (angles[name] ?? 0);
    angles[rotation.name] = sum;
  }
  return angles;
}

/** One hand, made of `material`, so many times as thick as usual. */
export class Hand {
  constructor(skeleton, material, thickness = 1) {
    this.thickness = thickness;
    this.skeleton = skeleton;
    this.root = new THREE.Group();
    this.joints = new Map();
    this.balls = new Map();
    this.tips = new Map();
    this.material = new THREE.MeshStandardMaterial({ color: 0x9aa7b5, roughness: 0.75, ...material });
    const ball = new THREE.SphereGeometry(thickness * JOINT_MM, 20, 14);
    this.geometries = [ball];
    for (const joint of skeleton.joints) {
      const object = new THREE.Group();
      object.position.fromArray(joint.offset);
      const [w, x, y, z] = joint.orientation;
      const frame = {
        object, rest: new THREE.Quaternion(x, y, z, w), axis: new THREE.Vector3().fromArray(joint.axis), joint,
      };
      const parent = joint.parent === null ? this.root : this.joints.get(joint.parent).object;
      parent.add(object);
      this.joints.set(joint.name, frame);
      if (joint.parent !== null) this._bone(parent, new THREE.Vector3().fromArray(joint.offset));
      for (const rotation of Object.keys(joint.rotations)) {
        // Each ball has a colour of its own: how uncertain its rotation is, and whether it is chosen.
        const mesh = new THREE.Mesh(ball, this.material.clone());
        mesh.userData.rotation = rotation;
        object.add(mesh);
        const balls = this.balls.get(rotation) ?? [];
        balls.push(mesh);
        this.balls.set(rotation, balls);
      }
    }
    for (const tip of skeleton.tips) {
      const parent = this.joints.get(tip.joint).object;
      const end = new THREE.Mesh(ball, this.material);
      end.position.fromArray(tip.offset);
      end.scale.setScalar(0.8);
      parent.add(end);
      this._bone(parent, end.position);
      this.tips.set(tip.finger, end);
    }
    this.pose({});
  }

  _bone(parent, to) {
    const length = to.length();
    if (length < 1) return;
    const radius = this.thickness * BONE_MM;
    const geometry = new THREE.CylinderGeometry(radius, radius, length, 14);
    this.geometries.push(geometry);
    const bone = new THREE.Mesh(geometry, this.material);
    bone.position.copy(to).multiplyScalar(0.5);
    bone.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.clone().normalize());
    parent.add(bone);
  }

  /** Turn the joints; `given` has degrees by rotation. */
  pose(given) {
    const angles = completed(this.skeleton, given);
    const turn = new THREE.Quaternion();
    for (const { object, rest, axis, joint } of this.joints.values()) {
      let angle = 0;
      for (const [name, weight] of Object.entries(joint.rotations)) angle += weight * angles[name];
      object.quaternion.copy(rest).multiply(turn.setFromAxisAngle(axis, angle * RADIANS));
    }
  }

  /** Where joints and fingertips are now, in mm in the forearm's frame: {joints: {name: [x, y, z]}, tips}. */
  places() {
    this.root.updateMatrixWorld(true);
    const inverse = this.root.matrixWorld.clone().invert();
    const place = (object) => object.getWorldPosition(new THREE.Vector3()).applyMatrix4(inverse).toArray();
    const joints = {}, tips = {};
    for (const [name, { object }] of this.joints) joints[name] = place(object);
    for (const [finger, object] of this.tips) tips[finger] = place(object);
    return { joints, tips };
  }

  /** Colour (a number) and size (1 is usual) of one rotation's joint. */
  mark(rotation, color, size) {
    for (const mesh of this.balls.get(rotation) ?? []) {
      mesh.material.color.setHex(color);
      mesh.scale.setScalar(size);
    }
  }

  /** Let light through: `share` 1 is solid. */
  fade(share) {
    for (const material of [this.material, ...[...this.balls.values()].flat().map((mesh) => mesh.material)]) {
      material.opacity = share;
    }
  }

  dispose() {
    for (const geometry of this.geometries) geometry.dispose();
    for (const meshes of this.balls.values()) for (const mesh of meshes) mesh.material.dispose();
    this.material.dispose();
  }
}

/** A rod from each fingertip of one hand to the same one of another. */
export class TipGaps {
  constructor() {
    this.root = new THREE.Group();
    this.geometry = new THREE.CylinderGeometry(GAP_MM, GAP_MM, 1, 10);
    // Seen through both hands: most distances are shorter than a fingertip is thick.
    this.material = new THREE.MeshBasicMaterial({ color: GAP, depthTest: false, transparent: true });
    this.rods = new Map();
  }

  draw(hand, other) {
    const from = hand.places().tips, to = other.places().tips;
    const up = new THREE.Vector3(0, 1, 0);
    for (const finger of Object.keys(from)) {
      if (!this.rods.has(finger)) {
        const made = new THREE.Mesh(this.geometry, this.material);
        made.renderOrder = 1;
        this.rods.set(finger, made);
        this.root.add(made);
      }
      const rod = this.rods.get(finger);
      const start = new THREE.Vector3(...from[finger]), way = new THREE.Vector3(...to[finger]).sub(start);
      const length = way.length();
      rod.visible = length > LEAST_GAP_MM;
      if (!rod.visible) continue;
      rod.position.copy(start).addScaledVector(way, 0.5);
      rod.scale.set(1, length, 1);
      rod.quaternion.setFromUnitVectors(up, way.normalize());
    }
  }

  dispose() {
    this.geometry.dispose();
    this.material.dispose();
  }
}

/** The part of a hand's view that does not know what it shows: camera, light, turning, picking.
 *
 * It draws when something has changed and the browser shows the page; `before` is called before each picture.
 */
export class Stage {
  constructor(canvas, OrbitControls, before) {
    this.canvas = canvas;
    this.before = before;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_DEG, 1, 10, 4000);
    this.camera.up.set(1, 0, 0); // fingers point up
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x667788, 2.2));
    const light = new THREE.DirectionalLight(0xffffff, 1.6);
    this.camera.add(light);
    this.scene.add(this.camera);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(85, 0, 0);
    this.controls.addEventListener("change", () => this.redraw());
    this.raycaster = new THREE.Raycaster();
    this.drawn = 0;
    this.resizer = new ResizeObserver(() => this.resize());
    this.resizer.observe(canvas.parentElement);
    this.resize();
  }

  /** "back" (of the hand), "palm", "side" (thumb's side) or "corner" (between back and side) of a `hand`. */
  look(from, hand = "right") {
    const corner = [30, 310, 385];
    const away = { back: [0, 0, 520], palm: [0, 0, -520], side: [0, 520, 60], corner }[from];
    const thumb = hand === "left" ? -1 : 1; // a left hand is the right one's mirror image
    this.camera.position.set(85 + away[0], thumb * away[1], away[2]);
    this.controls.update();
    this.redraw();
  }

  zoom(factor) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    offset.setLength(Math.min(1500, Math.max(150, offset.length() * factor)));
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.redraw();
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    // On a narrow screen the width decides how much is seen.
    const narrow = Math.max(1, 0.95 / this.camera.aspect);
    this.camera.fov = 2 * Math.atan(Math.tan((FIELD_DEG / 2) * RADIANS) * narrow) / RADIANS;
    this.camera.updateProjectionMatrix();
    this.redraw();
  }

  /** Where a joint is seen, in px from the canvas' upper left corner. */
  seenAt(object) {
    const { clientWidth, clientHeight } = this.canvas;
    const at = object.getWorldPosition(new THREE.Vector3()).project(this.camera);
    return { x: ((at.x + 1) / 2) * clientWidth, y: ((1 - at.y) / 2) * clientHeight };
  }

  /** The rotations of `hand` whose joints are in one place under a pointer event: bending first, then spreading. */
  picked(event, hand) {
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2,
    );
    this.raycaster.setFromCamera(at, this.camera);
    const hits = this.raycaster.intersectObjects([...hand.balls.values()].flat(), false);
    const near = hits.filter(({ distance }) => distance - hits[0].distance < JOINT_MM);
    const names = [...new Set(near.map(({ object }) => object.userData.rotation))];
    return names.sort((one, other) => one.endsWith("_ABD") - other.endsWith("_ABD"));
  }

  /** Several changes before the browser's next frame are one picture. */
  redraw() {
    this.waits ||= requestAnimationFrame(() => {
      this.waits = 0;
      this.before();
      this.drawn += 1;
      this.renderer.render(this.scene, this.camera);
    });
  }

  dispose() {
    cancelAnimationFrame(this.waits);
    this.resizer.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

export { THREE };
