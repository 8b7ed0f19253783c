// What the page takes from three.js, without its types.
export const Color: any, DirectionalLight: any, Fog: any, HemisphereLight: any, PCFShadowMap: any, PerspectiveCamera: any, Scene: any;
export const Vector3: any, WebGLRenderer: any, BoxGeometry: any, CapsuleGeometry: any, Group: any, Mesh: any, MeshLambertMaterial: any;
export const SphereGeometry: any, OrthographicCamera: any, BufferAttribute: any, BufferGeometry: any, DoubleSide: any, LineBasicMaterial: any;
export const LineSegments: any, PlaneGeometry: any;
