'use strict';
/*
 * YAML by js-yaml, restricted to what klann_ros.sanitize.yaml_text accepts, with the same meaning:
 * one document without anchors, tags, directives, repeated keys or keys that are not strings.
 */

const MAX_FILE_SIZE = 1000000;
const MAX_DEPTH = 20;
// PyYAML's limit of a key that stands in one line.
const MAX_KEY_LENGTH = 1000;
const NOT_A_STRING = '[object Object]';
const TRUE = /^(yes|Yes|YES|true|True|TRUE|on|On|ON)$/;
const FALSE = /^(no|No|NO|false|False|FALSE|off|Off|OFF)$/;
const NUMBER =
  /^([-+]?(0|[1-9]\d*)|[-+]?\d+(\.\d*)?[eE][-+]?\d+|[-+]?\d+\.\d*|\.\d+([eE][-+]\d+)?)$/;
// What YAML 1.1 reads as something else than a string: other numbers, dates, merge keys.
const NOT_PLAIN =
  /^([-+]?0[0-7_]+|[-+]?0[bx][\da-fA-F_]+|[-+]?\d[\d_]*_[\d_]*(\.[\d_]*([eE][-+]\d+)?)?|[-+]?\d[\d_]*\.[\d_]+([eE][-+]\d+)?|\.\d[\d_]*([eE][-+]\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)|\d{4}-\d\d?-\d\d?.*|=|<<)$/;

// A string without quotation marks that PyYAML does not take within brackets.
const UNSAFE_IN_FLOW = /^:|\?/;
// What may follow brackets in their last line.
const AFTER_FLOW = / *(?:[,\]}#:\n]|$)/y;

// What is refused before it is parsed.
const FORBIDDEN = [
  [
    /[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\u{10000}-\u{10ffff}]/u,
    'a character that YAML does not allow',
    'um caractere que YAML não permite',
  ],
  [/^(?! *#).*\t/m, 'a tab: use spaces', 'uma tabulação: use espaços'],
  [
    /^(%|\.\.\.|---(?!\s|$))/m,
    'only one document, without directives',
    'um só documento, sem diretivas',
  ],
  [/!<\?>/, 'tags are not accepted', 'tags não são aceitas'],
  [
    /\\u[dD][89a-fA-F]|\\U(?!00(0[\da-fA-F]|10))/,
    'an escape sequence that is not a character',
    'uma sequência de escape que não é um caractere',
  ],
];
// The parser's reasons that a user meets, in both languages; others are a syntax error in Portuguese.
const REASONS = [
  [/^duplicated/, 'a key is repeated', 'uma chave aparece duas vezes'],
  [/^nesting/, `more than ${MAX_DEPTH} levels`, `mais de ${MAX_DEPTH} níveis`],
  [
    /alias|anchor/,
    'anchors and aliases are not accepted: write it out',
    'âncoras e referências não são aceitas: escreva por extenso',
  ],
  [/tag/, 'tags are not accepted', 'tags não são aceitas'],
  [/indentation/, null, 'recuo errado'],
  [/within a (single|double) quoted/, null, 'faltam as aspas finais'],
  [/within a flow|flow collection/, null, 'falta uma vírgula ou o colchete final'],
  [/./, null, 'erro de sintaxe YAML'],
];

/** A node that is not a string: as a key it becomes NOT_A_STRING. */
class WrappedNode {
  constructor(value) {
    this.value = value;
  }
}

const SCHEMA = new jsyaml.Schema({
  implicit: [
    new jsyaml.Type('plain', {
      kind: 'scalar',
      // With a tag it is not plain.
      resolve: (raw, tag) => tag === undefined,
      construct: plainValue,
    }),
  ],
});

/** Return the value of a scalar without quotation marks. */
function plainValue(raw) {
  if (/^(~|null|Null|NULL|)$/.test(raw)) return null;
  if (TRUE.test(raw)) return true;
  if (FALSE.test(raw)) return false;
  const value = NUMBER.test(raw) ? Number(raw) : null;
  refuseUnless(
    value === null ? !NOT_PLAIN.test(raw) : Number.isFinite(value),
    `${printable(raw)} is not a finite decimal number; a string needs quotation marks`,
    `${printable(raw)} não é um número decimal finito; um texto precisa de aspas`,
  );
  return value === null ? raw : value;
}

/** Refuse anchors and tags of a node that is being read. */
function checkProperties({ anchor, tag }) {
  refuseUnless(anchor === null, ...REASONS[2].slice(1));
  refuseUnless(tag === null || tag === 'plain', ...REASONS[3].slice(1));
}

/** Refuse a scalar of several lines: PyYAML and js-yaml differ in some of them. */
function checkLines(source) {
  const own = source.replace(/^(\s+|#.*\n)*/, '').trimEnd();
  refuseUnless(!own.includes('\n'), 'a string must be in one line', 'um texto ocupa uma só linha');
}

/** Wrap a value that cannot be a key. */
function wrapNode(state) {
  const { result, kind } = state;
  const isKey = typeof result === 'string' || kind === 'mapping';
  // A value that might have begun a mapping is closed twice.
  if (!isKey && !(result instanceof WrappedNode)) state.result = new WrappedNode(result);
}

/** Return the content of a YAML text; a Refusal says in one line what is wrong. */
function readYaml(text) {
  refuseUnless(
    text.length <= MAX_FILE_SIZE,
    `it has ${text.length} characters, more than ${MAX_FILE_SIZE}`,
    `tem ${text.length} caracteres, mais de ${MAX_FILE_SIZE}`,
  );
  const plain = text.replace(/^\ufeff/, '').replace(/\r\n?/g, '\n');
  for (const [pattern, en, pt] of FORBIDDEN) {
    const found = pattern.exec(plain);
    if (found) throw refusalAt(plain, found.index, en, pt);
  }
  return contentOf(parsedNode(plain), '', 1);
}

function parsedNode(text) {
  let last = null;
  let lastUnsafe = -1;
  const begins = [];
  const listener = (event, state) => {
    last = state;
    if (event === 'open') begins.push(state.position);
    if (event === 'open' && begins.length === 1) return;
    checkProperties(state);
    if (event === 'open') return;
    const { kind, tag, result, position } = state;
    const begin = begins.pop();
    if (kind === 'scalar') {
      checkLines(text.slice(begin, position));
      if (tag === 'plain' && UNSAFE_IN_FLOW.test(result)) lastUnsafe = position;
    } else if (/[\]}]/.test(text[position - 1])) {
      refuseUnless(
        lastUnsafe <= begin,
        'within brackets a string with ? or : needs quotation marks',
        'entre colchetes, um texto com ? ou : precisa de aspas',
      );
      AFTER_FLOW.lastIndex = position;
      refuseUnless(AFTER_FLOW.test(text), 'this does not belong here', 'isto não cabe aqui');
    }
    wrapNode(state);
  };
  try {
    return jsyaml.load(text, { schema: SCHEMA, maxDepth: MAX_DEPTH, listener });
  } catch (error) {
    if (error instanceof Refusal)
      throw refusalAt(text, last.position, error.texts.en, error.texts.pt);
    if (!(error instanceof jsyaml.YAMLException)) throw error;
    const [, en, pt] = REASONS.find(([pattern]) => pattern.test(error.reason));
    const at = error.mark ? error.mark.position : text.length;
    throw refusalAt(text, at, en || printable(error.reason, 100), pt);
  }
}

function refusalAt(text, at, en, pt) {
  const before = text.slice(0, at);
  const line = before.split('\n').length;
  const column = at - before.lastIndexOf('\n');
  return new Refusal(
    `line ${line}, column ${column}: ${en}`,
    `linha ${line}, coluna ${column}: ${pt}`,
  );
}

/** Return a parsed node as plain data; mappings have no prototype. */
function contentOf(node, place, depth) {
  refuseUnless(depth <= MAX_DEPTH, ...REASONS[1].slice(1));
  const value = node instanceof WrappedNode ? node.value : node;
  if (Array.isArray(value))
    return value.map((item, i) => contentOf(item, `${place}[${i}]`, depth + 1));
  if (!isMapping(value)) return value === undefined ? null : value;
  const map = Object.create(null);
  for (const [key, item] of Object.entries(value)) {
    if (key === NOT_A_STRING || key === 'null' || key.length > MAX_KEY_LENGTH)
      wrong(
        place,
        'a key is not a short string: write it in quotation marks',
        'uma chave não é um texto curto: escreva-a entre aspas',
      );
    map[key] = contentOf(item, place ? `${place}.${key}` : key, depth + 1);
  }
  return map;
}
