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

// Each rule takes a value and its place.

function aMapping(value, place) {
  if (!isMapping(value))
    wrong(place, `${short(value)} must be a mapping`, `${short(value)} tem de ser um mapeamento`);
}

function aNumber(value, place) {
  if (typeof value !== 'number')
    wrong(place, `${short(value)} must be a number`, `${short(value)} tem de ser um número`);
  if (Math.abs(value) > LARGEST_NUMBER)
    wrong(
      place,
      `${short(value)} must be within +-1e+60`,
      `${short(value)} tem de estar entre +-1e+60`,
    );
}

function aLength(value, place) {
  aNumber(value, place);
  if (!(value > 0)) wrong(place, `${short(value)} must be > 0`, `${short(value)} tem de ser > 0`);
}

function anAmount(value, place) {
  aNumber(value, place);
  if (!(value >= 0))
    wrong(place, `${short(value)} must be >= 0`, `${short(value)} tem de ser >= 0`);
}

function aLengthUpTo(limit) {
  return (value, place) => {
    aLength(value, place);
    if (value > limit)
      wrong(
        place,
        `${short(value)} must be <= ${limit}`,
        `${short(value)} tem de ser <= ${limit}`,
      );
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
  if (typeof value !== 'string')
    wrong(place, `${short(value)} must be a text`, `${short(value)} tem de ser um texto`);
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
  if (typeof value !== 'boolean')
    wrong(
      place,
      `${short(value)} must be true or false`,
      `${short(value)} tem de ser true ou false`,
    );
}

function oneOf(...values) {
  return (value, place) => {
    if (!values.includes(value))
      wrong(
        place,
        `${short(value)} must be one of ${values.join(', ')}`,
        `${short(value)} tem de ser um de ${values.join(', ')}`,
      );
  };
}

function listOf(rule, least) {
  return (value, place) => {
    if (!Array.isArray(value))
      wrong(place, `${short(value)} must be a list`, `${short(value)} tem de ser uma lista`);
    if (value.length < least)
      wrong(place, `there must be ${least} or more`, `tem de haver ${least} ou mais`);
    value.forEach((item, i) => rule(item, `${place}[${i}]`));
  };
}

function aPoint(value, place) {
  if (!Array.isArray(value) || value.length !== 2)
    wrong(place, `${short(value)} must be [x, y]`, `${short(value)} tem de ser [x, y]`);
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
    if (keys.length < least)
      wrong(place, `there must be ${least} or more`, `tem de haver ${least} ou mais`);
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

const BODY_RULES = record([], {
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
  bars: listOf(aBar, 1),
});

function aBody(value, place) {
  BODY_RULES(value, place);
  if (!('bars' in value || 'slides' in value)) wrong(place, 'bars are missing', 'faltam bars');
}

const LINKAGE_RULES = record(['name', 'pivots', 'crank', 'foot', 'bodies'], {
  name: aTitle,
  source: aText,
  units: record([], { length: oneOf('m', 'cm', 'mm'), angle: oneOf('rad', 'deg') }),
  pivots: mapOf(aPoint, 1),
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
  bodies: mapOf(aBody, 1),
  start: mapOf(aNumber, 0),
  assembly: listOf(oneOf(1, -1), 1),
  at_change_points: oneOf(PARALLEL, CROSSED, SIGN),
});

/** Refuse content that is no linkage's file. */
function checkLinkageContent(content) {
  LINKAGE_RULES(content, '');
  if (!('start' in content || 'assembly' in content))
    wrong(
      '',
      'start is missing: an angle for every body, or in its place assembly: a sign for each dyad',
      'falta start: um ângulo para cada corpo, ou em seu lugar assembly: um sinal para cada díade',
    );
}
