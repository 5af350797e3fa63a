'use strict';
/* The other assemblies, and all lengths, bends and pivots. */

/** All assemblies at this angle, each a button that takes it. */
class AssembliesPanel {
  constructor(holder, lab, scene) {
    Object.assign(this, { holder, lab, scene });
    for (const event of ['linkage', 'numbers', 'pose']) lab.on(event, () => this.soon());
  }

  /** Show them when nothing else is to be done. */
  soon() {
    clearTimeout(this.waiting);
    const { linkage, alpha } = this.lab;
    if (this.scene.hasOthers && linkage.isDyadic)
      this.scene.showOthers(dyadPoses(linkage, alpha, 9).filter((pose) => !this.isDrawn(pose)));
    this.waiting = setTimeout(() => this.show(), this.lab.linkage.isDyadic ? 60 : 300);
  }

  show() {
    const { lab } = this;
    const poses = assemblyPoses(lab.linkage, lab.alpha, 16);
    const focused = this.holder.contains(document.activeElement);
    this.holder.replaceChildren(...poses.map((pose) => this.button(pose)));
    if (!poses.length) this.holder.append(made('p', '', say('oneAssembly')));
    if (focused && poses.length)
      (this.holder.querySelector('[aria-pressed=true]') || this.holder.firstChild).focus();
    this.scene.showOthers(poses.filter((pose) => !this.isDrawn(pose)));
  }

  isDrawn(pose) {
    const { pose: now, linkage } = this.lab;
    return !now.error && poseDistance(linkage, pose.x, now.x) < SAME_POSE;
  }

  button(pose) {
    const button = made('button');
    const isDrawn = this.isDrawn(pose);
    button.type = 'button';
    button.setAttribute('aria-pressed', String(isDrawn));
    const svg = document.createElementNS(SVG, 'svg');
    svg.setAttribute('aria-hidden', 'true');
    new DrawnLeg(new Drawing(svg, this.scene.drawing.plane), this.lab.shape, {
      hasLetters: false,
    }).show(pose.points);
    button.append(
      svg,
      made('span', '', `${signsText(pose.signs)} ${say(isDrawn ? 'taken' : 'take')}`),
    );
    button.addEventListener('click', () => this.lab.setSigns(pose));
    return button;
  }
}

/** Lengths, bends and pivots: each a slider and a number. */
class NumbersPanel {
  constructor(holder, lab) {
    this.holder = holder;
    this.lab = lab;
    lab.on('linkage', () => this.build());
    lab.on('numbers', () => this.show());
  }

  build() {
    const { dimensions } = this.lab.linkage.structure;
    this.rows = dimensions.map((dimension, n) => this.row(dimension, n));
    this.holder.replaceChildren(...this.rows.map(({ node }) => node));
    this.show();
  }

  row(dimension, n) {
    const isAngle = dimension.kind === 'bend';
    const sense = this.lab.isKlann ? senseOf(dimension.name) : 1;
    const scale = isAngle ? (sense * 360) / TAU : 1000;
    const value = this.lab.numbers[n] * scale;
    const size = this.lab.linkage.size * 1000;
    const node = made('div');
    const label = made('label');
    label.htmlFor = `number-${n}`;
    const slider = Object.assign(made('input'), { type: 'range', step: 'any' });
    const isLength = ['length', 'brace'].includes(dimension.kind);
    slider.min = isLength ? 0.3 * value : value - (isAngle ? 90 : size / 2);
    slider.max = isLength ? 1.7 * value : value + (isAngle ? 90 : size / 2);
    const take = (shown) => this.lab.setNumber(n, shown / scale);
    const field = new DecimalField(this.lab, {
      id: `number-${n}`,
      unit: isAngle ? '°' : 'mm',
      isSigned: !isLength,
      value: () => this.lab.numbers[n] * scale,
      take,
    });
    slider.addEventListener('input', () => {
      this.lab.begin();
      this.lab.isDragged = true;
      const pixels = slider.clientWidth || 200;
      take(rounded(Number(slider.value), roundStep((slider.max - slider.min) / pixels)));
      this.lab.isDragged = false;
    });
    slider.addEventListener('change', () => this.lab.commit());
    node.append(label, slider, field.input, made('span', 'quiet', isAngle ? '°' : 'mm'));
    node.append(field.reason);
    return { node, slider, field, label, scale, dimension };
  }

  show() {
    if (!this.rows) return;
    const { linkage, isKlann } = this.lab;
    const parameters = isKlann ? klannParameters(linkage) : {};
    this.rows.forEach(({ slider, field, label, scale, dimension }, n) => {
      const value = linkage.numbers[n] * scale;
      label.textContent = dimensionText(dimension.name, linkage.numbers[n], parameters);
      slider.setAttribute('aria-label', label.textContent);
      if (document.activeElement !== slider) slider.value = value;
      field.show();
      slider.setAttribute(
        'aria-valuetext',
        `${decimals(value, 1)} ${scale === 1000 ? 'mm' : '°'}`,
      );
    });
  }
}

/** Return what a number is called, also as a parameter; of a leg that is not where its parameters are. */
function dimensionText(name, number, parameters) {
  const [, kind, what] = /^(bend|direction) of (.*)$/.exec(name) || [null, null, name];
  const text = kind ? say(kind, what) : name;
  if (!Object.hasOwn(parameters, name)) return text;
  const [word, value] = parameters[name];
  if (senseOf(name) < 0) return `\u2212${text} (${word})`;
  return value === number ? `${text} (${word})` : `${text} (${word} = ${lengthText(value)})`;
}
