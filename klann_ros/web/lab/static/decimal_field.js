'use strict';
/* Numbers that are typed and shown as the page's language writes them. */

const MAX_DECIMAL_LENGTH = 40;
const NUMBER_AND_UNIT =
  /^\s*([-+\u2212\u2013]?[\d.,]*(?:e[-+\u2212\u2013]?(?:\d+|$))?)\s*(.*?)\s*$/is;
const UNITS_OFFERED = { mm: 'mm, cm, m, in', '°': 'deg, rad', 'rad/s': 'rad/s, rpm' };
// What a unit may begin with.
const UNIT = /^[\p{L}°º'"″′]/u;

/** Return the number of a typed text; null while it is incomplete, a Refusal if it is none. */
function decimalOf(text) {
  const plain = text.trim().replace(/[\u2212\u2013]/g, '-');
  const [mark, other] = language.now === 'pt' ? [',', '.'] : ['.', ','];
  if (new RegExp(`^[-+]?(\\d*\\${mark}?\\d*e[-+]?|\\${mark})?$`, 'i').test(plain)) return null;
  const isNumber = new RegExp(`^[-+]?(\\d+\\${mark}?\\d*|\\${mark}\\d+)(e[-+]?\\d+)?$`, 'i').test(
    plain,
  );
  const number = Number(plain.replace(',', '.'));
  if (!isNumber || plain.length > MAX_DECIMAL_LENGTH || !Number.isFinite(number)) {
    refuseText(plain.includes(other) ? 'wrongSeparator' : 'noNumber', plain);
  }
  return number;
}

/**
 * Return the number [unit] of a typed text, which may have a unit of its own; a Refusal of no number.
 *
 * null while it may be the begin of one; `isEnd`: it is all that there is.
 */
function quantityOf(text, unit, isEnd = true) {
  const [, digits, word] = NUMBER_AND_UNIT.exec(text);
  const number = decimalOf(digits || word);
  if (number === null && (!text.trim() || (!isEnd && !word))) return null;
  if (!word && number !== null) return number;
  if (number === null || !UNIT.test(word)) return refuseText('noNumber', text);
  const factor = conversionFactor(UNITS, word, unit);
  if (factor) return Number((number * factor).toPrecision(15));
  // It may become one.
  if (!isEnd) return null;
  return refuseText('noUnit', word, UNITS_OFFERED[unit]);
}

function refuseText(key, text, units) {
  const [en, pt] = [TEXTS.en, TEXTS.pt].map((texts) => texts[key](printable(text), units));
  throw new Refusal(en, pt);
}

/**
 * A text field with a number, which the arrow keys change by 1, with shift by 10.
 *
 * While it is typed, what it says so far holds if it is legal, and else what held before: a refused
 * entry changes nothing. The reason stands in `reason`, until the next entry.
 */
class DecimalField {
  /**
   * `value()` returns the number to show, `take(number)` takes a typed one as an edit of the lab;
   * both in the unit, 'mm' or '°'. `revert()` takes back what is no edit of the lab.
   */
  constructor(lab, { id = '', unit, isSigned = true, digits = 8, value, take, revert = () => {} }) {
    Object.assign(this, { lab, unit, digits, value, take, revert });
    DecimalField.count = (DecimalField.count || 0) + 1;
    this.reason = Object.assign(made('p', 'reason'), { id: `reason-${DecimalField.count}` });
    this.reason.hidden = true;
    // The number pad of some telephones has no minus.
    const inputMode = isSigned ? 'text' : 'decimal';
    this.input = Object.assign(made('input'), {
      type: 'text',
      inputMode,
      id,
      autocomplete: 'off',
    });
    this.input.className = 'decimal';
    this.input.maxLength = MAX_DECIMAL_LENGTH;
    this.input.setAttribute('aria-describedby', this.reason.id);
    this.input.addEventListener('input', () => this.read(false));
    this.input.addEventListener('keydown', (event) => {
      const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!way || event.altKey || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      lab.begin();
      take(Number((value() + way * (event.shiftKey ? 10 : 1)).toPrecision(12)));
      this.explain(lab.refusal);
      this.show(true);
    });
    this.input.addEventListener('change', () => this.end());
    this.input.addEventListener('blur', () => this.end());
  }

  /** Take what is typed; at the end of the entry an incomplete one is refused. */
  read(isEnd) {
    const { lab, input, unit } = this;
    lab.begin();
    lab.replace(() => {
      this.revert();
      const number = quantityOf(input.value, unit, isEnd);
      this.isIncomplete = number === null;
      if (number !== null) this.take(number);
    });
    this.explain(lab.refusal);
  }

  explain(refusal) {
    this.reason.hidden = !refusal;
    this.reason.textContent = refusal ? refusal.texts[language.now] : '';
    this.input.setAttribute('aria-invalid', String(Boolean(refusal)));
  }

  end() {
    if (this.isIncomplete && this.input.value.trim()) this.read(true);
    this.isIncomplete = false;
    this.lab.commit();
    this.show(true);
  }

  /** Show the number, but not over what is being typed. */
  show(isForced = false) {
    if (!isForced && document.activeElement === this.input) return;
    if (!isForced) this.explain(null);
    const text = String(Number(this.value().toPrecision(this.digits)));
    this.input.value = language.now === 'pt' ? text.replace('.', ',') : text;
  }
}
