'use strict';
/* Numbers that are typed and shown as the page's language writes them. */

const MAX_DECIMAL_LENGTH = 40;

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
    const key = plain.includes(other) ? 'wrongSeparator' : 'noNumber';
    throw new Refusal(TEXTS.en[key](printable(plain)), TEXTS.pt[key](printable(plain)));
  }
  return number;
}

/** A text field with a number, which the arrow keys change by 1, with shift by 10. */
class DecimalField {
  /** `value()` returns the number to show, `take(number)` takes a typed one as an edit of the lab. */
  constructor(lab, { id = '', isSigned = true, digits = 8, value, take }) {
    Object.assign(this, { digits, value });
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
    this.input.addEventListener('input', () => {
      lab.begin();
      lab.attempt(() => {
        const number = decimalOf(this.input.value);
        if (number !== null) take(number);
      });
    });
    this.input.addEventListener('keydown', (event) => {
      const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!way || event.altKey || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      lab.begin();
      take(Number((value() + way * (event.shiftKey ? 10 : 1)).toPrecision(12)));
      this.show(true);
    });
    this.input.addEventListener('change', () => this.end(lab));
    this.input.addEventListener('blur', () => this.end(lab));
  }

  end(lab) {
    lab.commit();
    this.show(true);
  }

  /** Show the number, but not over what is being typed. */
  show(isForced = false) {
    if (!isForced && document.activeElement === this.input) return;
    const text = String(Number(this.value().toPrecision(this.digits)));
    this.input.value = language.now === 'pt' ? text.replace('.', ',') : text;
  }
}
