'use strict';
/* What a linkage's file must look like: the rules of schema.json, and a line for each that is broken. */

const NAME = /^[A-Za-z][A-Za-z0-9_]{0,59}$/;
const LARGEST_NUMBER = 1e60;

function wrong(place, en, pt) {
  const where = place ? `${place}: ` : '';
  throw new Refusal(where + en, where + pt);
}

function short(value) {
  return printable(typeof value === 'string' ? `'${value}'` : JSON.stringify(value), 40);
}

function isMapping(value) {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function must(condition, value, place, en, pt) {
  if (!condition) wrong(place, `${short(value)} must be ${en}`, `${short(value)} tem de ser ${pt}`);
}

// Each rule takes a value and its place.

function aMapping(value, place) {
  must(isMapping(value), value, place, 'a mapping', 'um mapeamento');
}

function aNumber(value, place) {
  must(typeof value === 'number', value, place, 'a number', 'um número');
  must(Math.abs(value) <= LARGEST_NUMBER, value, place, 'within +-1e+60', 'de -1e+60 a 1e+60');
}

function aLength(value, place) {
  aNumber(value, place);
  must(value > 0, value, place, '> 0', '> 0');
}

function anAmount(value, place) {
  aNumber(value, place);
  must(value >= 0, value, place, '>= 0', '>= 0');
}

function aLengthUpTo(limit) {
  return (value, place) => {
    aLength(value, place);
    must(value <= limit, value, place, `<= ${limit}`, `<= ${limit}`);
  };
}

function aName(value, place) {
  if (typeof value !== 'string' || !NAME.test(value))
    wrong(
      place,
      `${short(value)} is no name: letters, digits and _, a letter first`,
      `${short(value)} não é um nome: letras, algarismos e _, começando por letra`,
    );
}

function aMaterial(value, place) {
  if (typeof value === 'number') aLengthUpTo(30000)(value, place);
  else aName(value, place);
}

function aText(value, place) {
  must(typeof value === 'string', value, place, 'a text', 'um texto');
}

function aTitle(value, place) {
  aText(value, place);
  const length = Array.from(value).length;
  if (!length || length > 200 || /[\x00-\x1f\x7f]/.test(value))
    wrong(
      place,
      `${short(value)} is no name: a line of up to 200 characters`,
      `${short(value)} não é um nome: uma linha de até 200 caracteres`,
    );
}

function truth(value, place) {
  must(typeof value === 'boolean', value, place, 'true or false', 'true ou false');
}

function oneOf(...values) {
  const names = values.join(', ');
  return (value, place) =>
    must(values.includes(value), value, place, `one of ${names}`, `um de ${names}`);
}

function atLeast(least, values, place) {
  if (values.length < least)
    wrong(place, `there must be ${least} or more`, `tem de haver ${least} ou mais`);
}

function listOf(rule, least) {
  return (value, place) => {
    must(Array.isArray(value), value, place, 'a list', 'uma lista');
    atLeast(least, value, place);
    value.forEach((item, i) => rule(item, `${place}[${i}]`));
  };
}

function names(value, place) {
  listOf(aName, 1)(value, place);
  if (value.length > 200 || new Set(value).size < value.length)
    wrong(
      place,
      'there must be 200 names or fewer, each of them once',
      'tem de haver até 200 nomes, cada um uma só vez',
    );
}

function aPoint(value, place) {
  must(Array.isArray(value) && value.length === 2, value, place, '[x, y]', '[x, y]');
  value.forEach((item, i) => aNumber(item, `${place}[${i}]`));
}

function aSeat(value, place) {
  aPoint(value, place);
  value.forEach((item, i) => aLength(item, `${place}[${i}]`));
}

function anEnd(value, place) {
  if (typeof value !== 'string') aPoint(value, place);
}

function mapOf(rule, least) {
  return (value, place) => {
    aMapping(value, place);
    const keys = Object.keys(value);
    atLeast(least, keys, place);
    for (const key of keys) {
      aName(key, place);
      rule(value[key], `${place}.${key}`);
    }
  };
}

function record(required, rules) {
  return (value, place) => {
    aMapping(value, place);
    for (const key of required)
      if (!(key in value)) wrong(place, `${key} is missing`, `falta ${key}`);
    for (const key of Object.keys(value)) {
      const known = Object.keys(rules);
      if (!known.includes(key))
        wrong(
          place,
          `${short(key)} is unknown here: there can be ${known.join(', ')}`,
          `${short(key)} é desconhecido aqui: pode haver ${known.join(', ')}`,
        );
      rules[key](value[key], place ? `${place}.${key}` : key);
    }
  };
}

const BRACE = record(['from', 'length', 'side'], {
  from: aName,
  length: aLength,
  side: oneOf('left', 'right'),
});

const BAR_RULES = record(['from', 'to', 'length'], {
  from: aName,
  to: aName,
  length: aLength,
  bend: aNumber,
  brace: BRACE,
});

function aBar(value, place) {
  BAR_RULES(value, place);
  if ('bend' in value && 'brace' in value)
    wrong(place, 'bend and brace exclude each other', 'bend e brace excluem-se');
}

const BODY_KEYS = {
  slides: record(['along', 'from', 'to'], {
    along: aName,
    from: aName,
    to: aName,
    direction: aNumber,
  }),
  mass: anAmount,
  centre: aPoint,
  inertia: anAmount,
  clockwise: truth,
};

/** Return the rule of a body that has a list under a key, unless it slides. */
function bodyRule(key, list) {
  const rules = record([], { ...BODY_KEYS, [key]: list });
  return (value, place) => {
    rules(value, place);
    if (!(key in value || 'slides' in value))
      wrong(place, `it must have ${key}, or slides`, `falta ${key}, ou slides`);
  };
}

const LINK_RULES = bodyRule('points', names);

function aLink(value, place) {
  if (Array.isArray(value)) names(value, place);
  else LINK_RULES(value, place);
}

const LINKAGE_KEYS = {
  name: aTitle,
  source: aText,
  units: record([], { length: oneOf('m', 'cm', 'mm'), angle: oneOf('rad', 'deg') }),
  crank: aName,
  foot: aName,
  leg: truth,
  density: anAmount,
  mass_source: aTitle,
  parts: record([], {
    material: aMaterial,
    pins: aMaterial,
    infill: aLengthUpTo(1),
    wall: anAmount,
    thickness: aLength,
    width: aLength,
    hole: aLength,
    holes: mapOf(aLength, 0),
    seat: aSeat,
    seats: mapOf(aSeat, 0),
    washer: anAmount,
    clearance: anAmount,
  }),
  springs: listOf(
    record(['from', 'to', 'stiffness'], {
      from: anEnd,
      to: anEnd,
      stiffness: anAmount,
      free_length: anAmount,
    }),
    0,
  ),
  torsion_springs: listOf(
    record(['joint', 'between', 'stiffness'], {
      joint: aName,
      between: listOf(aName, 2),
      stiffness: anAmount,
      rest_angle: aNumber,
    }),
    0,
  ),
  assembly: listOf(oneOf(1, -1), 1),
  at_change_points: oneOf(PARALLEL, CROSSED, SIGN),
};
const BAR_FORM = record(['name', 'pivots', 'crank', 'foot', 'bodies'], {
  ...LINKAGE_KEYS,
  pivots: mapOf(aPoint, 1),
  bodies: mapOf(bodyRule('bars', listOf(aBar, 1)), 1),
  start: mapOf(aNumber, 0),
});
const POINT_FORM = record(['name', 'points', 'ground', 'crank', 'foot', 'links'], {
  ...LINKAGE_KEYS,
  points: mapOf(aPoint, 1),
  ground: names,
  links: mapOf(aLink, 1),
});

/** Refuse content that is no linkage's file. */
function checkLinkageContent(content) {
  aMapping(content, '');
  if ('points' in content || 'ground' in content || 'links' in content) {
    POINT_FORM(content, '');
    return;
  }
  BAR_FORM(content, '');
  if (!('start' in content || 'assembly' in content))
    wrong(
      '',
      'start is missing: an angle for every body, or in its place assembly: a sign for each dyad',
      'falta start: um ângulo para cada corpo, ou em seu lugar assembly: um sinal para cada díade',
    );
}
