// Writes three.min.js: npm install three@0.187.0 esbuild@0.28.2, then node build.mjs
import { build } from 'esbuild';
import { readFile } from 'node:fs/promises';

const NAMES = `
  WebGLRenderer Scene PerspectiveCamera Group Mesh InstancedMesh LineSegments Line
  BufferGeometry BufferAttribute BoxGeometry ExtrudeGeometry ShapeGeometry Shape Path
  MeshBasicMaterial MeshLambertMaterial LineBasicMaterial HemisphereLight DirectionalLight
  Color Fog Vector2 Vector3 Matrix4 Quaternion Euler DoubleSide
`;
// Shaders of materials and effects that no page uses: their sources are left out.
const UNUSED =
  /physical|toon|matcap|phong|sprite|points|vsm|equirect|cube|distance|shadow|transmission|iridescence|clearcoat|envmap|bumpmap|normalmap|displacement|morph|skin|tonemapping_pars|lightprobes|DFGLUT|background|meshnormal|linedashed/i;
// A map would be a whole subsystem: no page is in virtual reality, or has reflections.
const shaders = {
  name: 'shaders',
  setup({ onLoad }) {
    onLoad({ filter: /ShaderChunk[/].*\.glsl\.js$/ }, async ({ path }) => {
      const text = await readFile(path, 'utf8');
      const isUnused = UNUSED.test(path.split('/').pop());
      return { contents: isUnused ? 'export default "";' : shortened(text) };
    });
    onLoad({ filter: /ShaderLib[/].*\.glsl\.js$/ }, async ({ path }) => {
      const text = await readFile(path, 'utf8');
      const isUnused = UNUSED.test(path.split('/').pop());
      const empty = 'export const vertex = "", fragment = "";';
      return { contents: isUnused ? empty : shortened(text) };
    });
  },
};

function shortened(text) {
  return text.replace(/\/\*[^]*?\*\/|\/\/.*$/gm, '').replace(/^\s+/gm, '');
}

await build({
  stdin: { contents: `export { ${NAMES.trim().split(/\s+/)} } from 'three/src/Three.js';`, resolveDir: '.' },
  bundle: true, minify: true, format: 'iife', globalName: 'THREE', target: 'es2020',
  legalComments: 'none', outfile: 'three.min.js', plugins: [shaders],
});
