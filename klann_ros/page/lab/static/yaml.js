'use strict';
/*
 * The part of YAML in which linkages and parameters are written: mappings and lists, in blocks or in
 * brackets, texts of one line and numbers. Whatever else YAML has is refused, in one line; and what
 * is taken means the same as to klann_ros.untrusted.yaml_text.
 */

const LONGEST_FILE = 1000000;
const DEEPEST = 20;
const NO_YAML = /[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\u{10000}-\u{10ffff}]/u;
const TRUE = /^(yes|Yes|YES|true|True|TRUE|on|On|ON)$/;
const FALSE = /^(no|No|NO|false|False|FALSE|off|Off|OFF)$/;
const NUMBER =
  /^([-+]?(0|[1-9]\d*)|[-+]?\d+(\.\d*)?[eE][-+]?\d+|[-+]?\d+\.\d*|\.\d+([eE][-+]\d+)?)$/;
const NOT_PLAIN =
  /^([-+]?0[0-7_]+|[-+]?0[bx][\da-fA-F_]+|[-+]?\d[\d_]*_[\d_]*(\.[\d_]*([eE][-+]\d+)?)?|[-+]?\d[\d_]*\.[\d_]+([eE][-+]\d+)?|\.\d[\d_]*([eE][-+]\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)|\d{4}-\d\d?-\d\d?.*|=|<<)$/;
const ESCAPES = {
  0: '\0',
  a: '\x07',
  b: '\b',
  t: '\t',
  '\t': '\t',
  n: '\n',
  v: '\v',
  f: '\f',
  r: '\r',
  e: '\x1b',
  ' ': ' ',
  '"': '"',
  '/': '/',
  '\\': '\\',
  N: '\x85',
  _: '\xa0',
  L: '\u2028',
  P: '\u2029',
};

class YamlReader {
  constructor(text) {
    refuseUnless(
      text.length <= LONGEST_FILE,
      `it has ${text.length} characters, more than ${LONGEST_FILE}`,
      `tem ${text.length} caracteres, mais de ${LONGEST_FILE}`,
    );
    this.text = text.replace(/^\ufeff/, '').replace(/\r\n?/g, '\n');
    this.at = 0;
    this.depth = 0;
    const wrong = NO_YAML.exec(this.text);
    if (wrong) {
      this.at = wrong.index;
      this.refuse('a character that YAML does not take', 'um caractere que YAML não aceita');
    }
  }

  /** Return the content of the text. */
  read() {
    this.skip();
    if (/^---(\s|$)/.test(this.text.slice(this.at, this.at + 4)) && !this.column()) {
      this.at += 3;
      this.skip();
    }
    const content = this.block(0);
    this.skip();
    if (this.at < this.text.length)
      this.refuse('this does not belong to what is above', 'isto não pertence ao que está acima');
    return content;
  }

  refuse(en, pt) {
    const before = this.text.slice(0, this.at);
    const line = before.split('\n').length;
    const column = this.at - before.lastIndexOf('\n');
    throw new Refusal(
      `line ${line}, column ${column}: ${en}`,
      `linha ${line}, coluna ${column}: ${pt}`,
    );
  }

  get next() {
    return this.text[this.at];
  }

  column() {
    return this.at - this.text.lastIndexOf('\n', this.at - 1) - 1;
  }

  /** Skip blanks in the line. */
  blanks() {
    while (this.next === ' ') this.at += 1;
    if (this.next === '\t') this.refuse('a tab: use blanks', 'uma tabulação: use espaços');
  }

  /** Skip blanks, comments and ends of lines. */
  skip() {
    for (;;) {
      this.blanks();
      const follows = /\s/.test(this.text[this.at - 1] || ' ');
      if (this.next === '#' && follows)
        while (this.at < this.text.length && this.next !== '\n') this.at += 1;
      if (this.next !== '\n') return;
      this.at += 1;
    }
  }

  /** Whether the line has nothing more, but for a comment. */
  lineEnds() {
    this.blanks();
    const isBlank = /\s/.test(this.text[this.at - 1] || ' ');
    return this.at >= this.text.length || this.next === '\n' || (this.next === '#' && isBlank);
  }

  inDepth(read) {
    this.depth += 1;
    if (this.depth > DEEPEST)
      this.refuse(`more than ${DEEPEST} levels`, `mais de ${DEEPEST} níveis`);
    const value = read();
    this.depth -= 1;
    return value;
  }

  /** Return what begins in one of the next lines, if it is so far in; null for nothing. */
  block(indent) {
    this.skip();
    const column = this.column();
    if (this.at >= this.text.length || column < indent) return null;
    this.checkMargin();
    return this.inDepth(() => this.node(column));
  }

  checkMargin() {
    if (!this.column() && /^(---|\.\.\.|%)/.test(this.text.slice(this.at, this.at + 3)))
      this.refuse('one document, without directives', 'um só documento, sem diretivas');
  }

  /** Return the list, mapping or value at this place of a line. */
  node(column) {
    if (this.isDash()) return this.list(column);
    const begin = this.at;
    if (this.next === '{' || this.next === '[') return this.lastOfLine(this.flow());
    this.scalar(false);
    this.blanks();
    const isKey = this.isColon();
    this.at = begin;
    return isKey ? this.mapping(column) : this.lastOfLine(this.scalar(false).value);
  }

  isDash() {
    return this.next === '-' && /[\s]|^$/.test(this.text[this.at + 1] || '');
  }

  isColon() {
    return this.next === ':' && /[\s]|^$/.test(this.text[this.at + 1] || '');
  }

  lastOfLine(value) {
    if (!this.lineEnds()) this.refuse('this does not belong here', 'isto não cabe aqui');
    return value;
  }

  list(column) {
    const items = [];
    do {
      this.at += 1;
      if (this.lineEnds()) items.push(this.block(column + 1));
      else items.push(this.inDepth(() => this.node(this.column())));
    } while (this.goesOn(column) && this.isDash());
    return items;
  }

  /** Go to the next line with content; return whether it is as far in. */
  goesOn(column) {
    this.skip();
    if (this.at >= this.text.length || this.column() < column) return false;
    this.checkMargin();
    if (this.column() > column)
      this.refuse(
        'this is further in than what is above',
        'isto está mais recuado do que o que está acima',
      );
    return true;
  }

  mapping(column) {
    const map = Object.create(null);
    do {
      if (this.isDash()) this.refuse('a list in a mapping', 'uma lista num mapeamento');
      const key = this.key(map);
      this.blanks();
      if (!this.isColon())
        this.refuse(`no ": " after ${printable(key)}`, `falta ": " depois de ${printable(key)}`);
      this.at += 1;
      map[key] = this.lineEnds() ? this.below(column) : this.inDepth(() => this.inline());
    } while (this.goesOn(column));
    return map;
  }

  /** Return the value of a key that stands in the lines below it; a list may be as far in. */
  below(column) {
    this.skip();
    const isList = this.isDash() && this.column() === column;
    return this.block(isList ? column : column + 1);
  }

  inline() {
    if (this.next === '{' || this.next === '[') return this.lastOfLine(this.flow());
    if (this.isDash())
      this.refuse('a list begins in a line of its own', 'uma lista começa numa linha própria');
    const { value } = this.scalar(false);
    return this.lastOfLine(value);
  }

  key(map, isFlow = false) {
    const begin = this.at;
    const { value, raw } = this.scalar(isFlow);
    if (typeof value !== 'string') {
      this.at = begin;
      this.refuse(
        `the name ${printable(raw)} is no text: write it in quotation marks`,
        `o nome ${printable(raw)} não é texto: escreva-o entre aspas`,
      );
    }
    if (value in map) {
      this.at = begin;
      this.refuse(`${printable(value)} is there twice`, `${printable(value)} aparece duas vezes`);
    }
    return value;
  }

  // In brackets.

  flow() {
    return this.inDepth(() => (this.next === '{' ? this.flowMapping() : this.flowList()));
  }

  flowValue() {
    return this.next === '{' || this.next === '['
      ? this.flow()
      : this.inDepth(() => this.scalar(true).value);
  }

  flowList() {
    const items = [];
    this.at += 1;
    for (this.skip(); this.next !== ']'; this.skip()) {
      items.push(this.flowValue());
      this.separator(']');
    }
    this.at += 1;
    return items;
  }

  flowMapping() {
    const map = Object.create(null);
    this.at += 1;
    for (this.skip(); this.next !== '}'; this.skip()) {
      const key = this.key(map, true);
      this.blanks();
      if (this.next !== ':')
        this.refuse(`no ": " after ${printable(key)}`, `falta ": " depois de ${printable(key)}`);
      this.at += 1;
      this.skip();
      map[key] = this.flowValue();
      this.separator('}');
    }
    this.at += 1;
    return map;
  }

  separator(end) {
    this.skip();
    if (this.next === ',') this.at += 1;
    else if (this.next !== end) this.refuse(`no , or ${end}`, `falta , ou ${end}`);
  }

  // Texts and numbers.

  scalar(isFlow) {
    if (this.next === '"') return this.doubleQuoted();
    if (this.next === "'") return this.singleQuoted();
    return this.plain(isFlow);
  }

  plain(isFlow) {
    const begin = this.at;
    if (/[&*]/.test(this.next || ''))
      this.refuse(
        'anchors and aliases are not taken: write it out',
        'âncoras e referências não são aceitas: escreva por extenso',
      );
    if (/[!|>%@`,[\]{}#\t]/.test(this.next || ','))
      this.refuse(
        'no text begins like this: use quotation marks',
        'nenhum texto começa assim: use aspas',
      );
    const isMark = /[-?:]/.test(this.next) && /[\s,[\]{}]|^$/.test(this.text[this.at + 1] || '');
    if (isMark || (isFlow && this.next === ':'))
      this.refuse(
        'no text begins like this: use quotation marks',
        'nenhum texto começa assim: use aspas',
      );
    while (this.at < this.text.length && !this.plainEnds(isFlow)) this.at += 1;
    const raw = this.text.slice(begin, this.at).trimEnd();
    this.at = begin + raw.length;
    return { raw, value: this.resolved(raw, begin) };
  }

  plainEnds(isFlow) {
    const [before, c, after] = [this.text[this.at - 1], this.next, this.text[this.at + 1] || '\n'];
    if (c === '\n' || c === '\t' || (c === '#' && before === ' ')) return true;
    if (c === ':' && /\s/.test(after)) return true;
    return isFlow && (/[,[\]{}]/.test(c) || (c === ':' && /[,[\]{}]/.test(after)));
  }

  resolved(raw, begin) {
    if (/^(~|null|Null|NULL|)$/.test(raw)) return null;
    if (TRUE.test(raw)) return true;
    if (FALSE.test(raw)) return false;
    const value = NUMBER.test(raw) ? Number(raw) : null;
    if (value === null ? NOT_PLAIN.test(raw) : !Number.isFinite(value)) {
      this.at = begin;
      this.refuse(
        `${printable(raw)} is no plain finite number, and no text without quotation marks`,
        `${printable(raw)} não é um número finito comum, nem texto sem aspas`,
      );
    }
    return value === null ? raw : value;
  }

  singleQuoted() {
    const found = /^'((?:[^'\n]|'')*)'/.exec(this.rest());
    if (!found)
      this.refuse('a text that does not end in its line', 'um texto que não termina na sua linha');
    this.at += found[0].length;
    return { raw: found[0], value: found[1].replaceAll("''", "'") };
  }

  doubleQuoted() {
    const found = /^"((?:[^"\\\n]|\\.)*)"/u.exec(this.rest());
    if (!found)
      this.refuse('a text that does not end in its line', 'um texto que não termina na sua linha');
    const value = found[1].replace(/\\(x.{0,2}|u.{0,4}|U.{0,8}|.)/gsu, (_, code) =>
      this.unescaped(code),
    );
    this.at += found[0].length;
    return { raw: found[0], value };
  }

  /** Return the line from here on, and no more: a text is one line. */
  rest() {
    const end = this.text.indexOf('\n', this.at);
    return this.text.slice(this.at, end < 0 ? this.text.length : end);
  }

  unescaped(code) {
    const number = /^(?:x[\da-fA-F]{2}|u[\da-fA-F]{4}|U[\da-fA-F]{8})$/.test(code)
      ? parseInt(code.slice(1), 16)
      : NaN;
    if (number <= 0x10ffff && !(number >= 0xd800 && number <= 0xdfff))
      return String.fromCodePoint(number);
    if (!(code in ESCAPES))
      this.refuse(
        `\\${printable(code)} stands for nothing`,
        `\\${printable(code)} não significa nada`,
      );
    return ESCAPES[code];
  }
}

/** Return the content of a YAML text; a Refusal for one that is none, or none that is taken. */
function readYaml(text) {
  return new YamlReader(text).read();
}
