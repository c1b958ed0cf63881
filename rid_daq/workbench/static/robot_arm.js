// The robot arm in the 3-D view: for each joint a fixed and a moving three.js group, and the meshes of the links.
import { BufferAttribute, BufferGeometry, Group, Matrix4, Mesh, Vector3 } from "./three.js";

/** @type {(rows: number[][]) => Matrix4} */
export const matrixOf = (rows) => new Matrix4().set(.../** @type {Sixteen} */ (rows.flat()));
/** @type {(values: readonly number[]) => Vector3} */
export const vectorOf = (values) => new Vector3(...values);

// Return one geometry for each link. `binary` contains first positions (float32), then indices (uint32), little-endian.
/** @type {(document: Api.SceneDocument, binary: ArrayBuffer) => BufferGeometry[]} */
export function linkGeometries({ links, vertices, triangles }, binary) {
  if (binary.byteLength !== 12 * (vertices + triangles))
    throw new Error(`The robot's shape has ${binary.byteLength} bytes instead of ${12 * (vertices + triangles)}: reload the page.`);
  const positions = new Float32Array(binary, 0, 3 * vertices);
  const indices = new Uint32Array(binary, 12 * vertices, 3 * triangles);
  return links.map(({ first_index: first, index_count: count }) => {
    const own = indices.subarray(first, first + count);
    const [least, most] = own.reduce(([low, high], each) => [Math.min(low, each), Math.max(high, each)], [Infinity, -1]);
    const made = new BufferGeometry();
    if (count === 0) return made;
    made.setAttribute("position", new BufferAttribute(positions.slice(3 * least, 3 * (most + 1)), 3));
    made.setIndex(new BufferAttribute(own.map((each) => each - least), 1));
    made.computeVertexNormals();
    return made;
  });
}

export class RobotArm {
  // `material(link)` returns the material of a link; link 0 is the robot's base.
  /** @param {Api.SceneDocument} document @param {BufferGeometry[]} geometries @param {(link: number) => import("three").Material} material */
  constructor(document, geometries, material) {
    this.joints = document.joints;
    this.base = new Group();
    /** @type {Group[]} */
    this.fixed = []; // frame of each joint at position 0
    /** @type {import("three").Object3D[]} */
    this.links = [this.base]; // frame of each link
    for (const { origin } of this.joints) {
      const fixed = new Group().add(new Group());
      fixed.applyMatrix4(matrixOf(origin));
      this.links[this.fixed.length].add(fixed);
      this.fixed.push(fixed);
      this.links.push(fixed.children[0]);
    }
    this.tool = new Group();
    if (document.tool) this.tool.applyMatrix4(matrixOf(document.tool));
    this.links[this.joints.length].add(this.tool);
    this.meshes = geometries.map((geometry, link) => {
      const mesh = new Mesh(geometry, material(link));
      mesh.visible = geometry.index !== null;
      this.links[link].add(mesh);
      return mesh;
    });
  }

  // Move the joints to the positions [rad or m].
  /** @type {(position: number[]) => void} */
  set(position) {
    this.joints.forEach(({ axis, kind }, i) => {
      const link = this.links[i + 1];
      if (kind === "prismatic") link.position.set(...axis).multiplyScalar(position[i]);
      else link.quaternion.setFromAxisAngle(vectorOf(axis), position[i]);
    });
    this.base.updateWorldMatrix(true, true);
  }

  // Upper limit of the distance from the base to the tool: sum of the lengths of the links [m]; the size of marks is
  // proportional to it.
  reach() {
    const lengths = [...this.fixed, this.tool].map((each) => each.position.length());
    return Math.max(0.05, lengths.reduce((sum, each) => sum + each, 0));
  }
}
