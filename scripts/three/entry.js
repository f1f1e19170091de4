// The parts of three.js that the viewer uses; esbuild leaves out the rest.
export {
  Bone, BufferAttribute, BufferGeometry, CanvasTexture, CircleGeometry, Color, DirectionalLight, DoubleSide,
  Group, HemisphereLight, Line, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, PCFShadowMap, PerspectiveCamera, PlaneGeometry, Scene, ShaderMaterial, ShadowMaterial,
  Skeleton, SkinnedMesh, Sprite, SpriteMaterial, SRGBColorSpace, Vector3,
  VideoTexture, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
