'use strict';
/*
 * The practice mode is packed (deflated) in the page, and unpacked when it is first opened: its
 * script and its styles are named in the page's policy, as all others.
 *
 *   #practice=newton&seed=12345&lang=pt
 */

// Kind and student number are refused by the exercises, which know them.
const PRACTICE_PARTS = { practice: /^/, seed: /^/, lang: /^(en|pt)$/ };

// The digits of base 85, as Python's b85encode has them, but without the begin of a tag.
const DIGITS =
  '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;.=>?@^_`{|}~';

function bytesOf(text) {
  const bytes = new DataView(new ArrayBuffer(text.length));
  for (let i = 0; i < text.length; i += 5) {
    let number = 0;
    for (let k = i; k < i + 5; k += 1) number = 85 * number + DIGITS.indexOf(text[k] || '~');
    bytes.setUint32(0.8 * i, number);
  }
  return bytes.buffer.slice(0, Math.floor(0.8 * text.length));
}

async function unpackedPractice() {
  refuseUnless(
    'DecompressionStream' in globalThis,
    'the exercises need a browser of 2023 or later',
    'os exercícios precisam de um navegador de 2023 ou mais novo',
  );
  const stream = new Blob([bytesOf(byId('packed').textContent)]).stream().pipeThrough(new DecompressionStream('deflate'));
  const { data, script, style } = await new Response(stream).json();
  document.head.append(Object.assign(made('style'), { textContent: style }));
  document.body.append(Object.assign(made('script'), { text: script }));
  return new globalThis.Practice(byId('practice'), { ...data, unitTable: UNITS });
}

function isPractising() {
  return byId('practice').parentNode.classList.contains('practising');
}

/** Show the exercise of an address's fragment, or say in a line what of it is wrong. */
async function openPractice(fragment) {
  let failure = null;
  try {
    const parts = linkParts(fragment, PRACTICE_PARTS);
    if ('lang' in parts) speak(parts.lang);
    lab.practice ??= await unpackedPractice();
    lab.practice.open(parts);
  } catch (error) {
    failure = error;
  }
  lab.attempt(() => {
    if (failure) throw failure;
    crank.isTurning = false;
    byId('practice').hidden = false;
    byId('practice').parentNode.classList.add('practising');
    clearTimeout(link.waiting);
    history.replaceState(null, '', lab.practice.fragment);
    lab.refusal = null;
    lab.tell('pose');
    lab.practice.title.focus();
  });
}

function closePractice() {
  byId('practice').hidden = true;
  byId('practice').parentNode.classList.remove('practising');
  history.replaceState(null, '', location.pathname);
  byId('practise').focus();
}
