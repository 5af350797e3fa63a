'use strict';
/* What is told beside the drawing: the state, figures, transmission angles, assemblies, numbers. */

function byId(id) {
  return document.getElementById(id);
}

function made(name, className = '', text = '') {
  const node = document.createElement(name);
  if (className) node.className = className;
  node.textContent = text;
  return node;
}

/** Return in words why a pose does not close. */
function whyText(error) {
  if (error instanceof LoopsOpen) return say('open_loops', turnText(error.nearest));
  const { names, block, shortfall, isFar } = error;
  const mm = lengthText(shortfall);
  if (!names[3]) {
    if (isFar) return say('farFromLine', names, block, mm);
    return shortfall ? say('nearLine', names, block, mm) : say('coincide', names, block);
  }
  if (isFar) return say('far', names, block, mm);
  return shortfall ? say('near', names, block, mm) : say('coincide', names, block);
}

/** The card of what is the case at this crank angle. */
class StatePanel {
  constructor(lab) {
    this.lab = lab;
    for (const event of ['linkage', 'numbers', 'pose']) lab.on(event, () => this.show());
    for (const event of ['linkage', 'turn']) lab.on(event, () => this.showTurn());
  }

  show() {
    const { pose, alpha, refusal, linkage } = this.lab;
    byId('refusal').hidden = !refusal;
    const line = refusal ? `${say('refused')}: ${refusal.texts[language.now]}` : '';
    if (byId('refusal').textContent !== line) byId('refusal').textContent = line;
    const state = byId('state');
    state.textContent = say(pose.error ? 'jams' : 'closes', turnText(alpha));
    state.classList.toggle('bad', Boolean(pose.error));
    byId('why').hidden = !pose.error;
    byId('why-text').textContent = pose.error ? whyText(pose.error) : '';
    byId('spare').textContent = pose.error ? '' : spareText(linkage, pose);
  }

  showTurn() {
    const { turn, linkage } = this.lab;
    if (!turn) return;
    byId('turn-text').textContent = arcsText(turn);
    byId('grashof').textContent = grashofText(linkage, turn);
    const changes = turn.isTurn ? changeTexts(linkage) : [];
    byId('changes').replaceChildren(...changes.map((text) => made('li', '', text)));
    const tiles = turn.pieces.some((poses) => poses.length) ? figuresOf(this.lab, turn) : [];
    byId('tiles').replaceChildren(
      ...tiles.map(([name, value, where]) => {
        const tile = made('div');
        const told = made('dd');
        told.append(made('b', '', value), made('span', '', where));
        tile.append(made('dt', '', name), told);
        return tile;
      }),
    );
  }
}

function spareText(linkage, pose) {
  const spare = linkage.blocks.map((block) => block.clearance(pose.u));
  const known = spare.filter((value) => value !== null && Number.isFinite(value));
  if (!known.length) return '';
  const least = Math.min(...known);
  return say('spare', lengthText(least), spare.indexOf(least) + 1);
}

/** Return a line for each change point: what is in line, and both ways on. */
function changeTexts(linkage) {
  const { changes, structure, blocks } = linkage;
  return changes.points.map((point) => {
    const block = blocks[point.block - 1];
    const names = block.unknowns.map((j) => structure.bodies[j].name).join(', ');
    const at = turnText(point.alpha);
    if (!block.isDyad) return say('coupledChange', at, names);
    const [taken, left] = [1, -1].map((factor) => {
      const rates = changes.rates(point, factor);
      return block.unknowns
        .map((j, i) => `${structure.bodies[j].name} ${rateText(rates[i], structure.bodies[j])}`)
        .join(', ');
    });
    const turn =
      changes.period > 1 ? `, ${say('turnOf', turnNumber(point.alpha, changes.period), changes.period)}` : '';
    const told = say('change', at + turn, names, taken, left);
    return point.isFree ? `${told} ${say('freeChange', names)}` : told;
  });
}

function rateText(rate, { slides }) {
  return slides ? `${lengthText(rate)}/rad` : decimals(rate + 0, 3);
}

/** Return the number of the turn, from 1, of those after which a linkage is back. */
function turnNumber(alpha, period) {
  // An angle that is shown as 0 begins a turn.
  return 1 + modulo(Math.floor((alpha + 1e-9) / TAU), period);
}

/** Return Grashof's law for the four-bar that the crank drives, and where its rocker turns back; or ''. */
function grashofText(linkage, turn) {
  const loop = fourBarOf(linkage);
  if (!loop) return '';
  const { sums, kind, motion } = grashofOf(loop.lengths);
  if (!kind) return '';
  const sign = { I: '<', II: '>', III: '=' }[kind];
  const motions = say('motions')[motion] || motion;
  const law = say('grashof', loop.names.join(', '), ...sums.map(lengthText), sign, kind, motions);
  if (!turn.isTurn || motion !== 'crank-rocker') return law;
  const limits = rockerLimits(linkage, turn, loop.rocker);
  const told = ['least', 'greatest'].flatMap((end) => [
    degreesText(wrap(limits[end])),
    turnText(limits[`${end}At`]),
  ]);
  return `${law} ${say('stationary', linkage.structure.angles[loop.rocker], ...told)}`;
}

function arcsText({ isTurn, arcs, linkage }) {
  if (!arcs.length) return say('nowhere');
  if (isTurn) {
    const { period } = linkage.changes;
    return say('fullTurn') + (period > 1 ? ` ${say('period', period)}` : '');
  }
  const texts = arcs.map(([start, end]) => `${turnText(start)} ${say('to')} ${turnText(end)}`);
  return say('arcs', texts.join(` ${say('and')} `));
}

/** Return a name of the published point as an owner: of a foot, or of a point of the coupler or not. */
function ofFoot({ linkage: { structure }, content }) {
  const { foot } = structure;
  if (isLeg(structure, content)) return say('ofFoot');
  const isCoupler = bodiesAt(structure, foot).some((body) => !isGuided(structure, body));
  return say(isCoupler ? 'ofCoupler' : 'ofPoint', foot);
}

function figuresOf(lab, turn) {
  const { linkage, content } = lab;
  const names = isLeg(linkage.structure, content) ? ['stride', 'lift'] : ['pathWidth', 'pathHeight'];
  const tiles = [
    [say(names[0]), lengthText(turn.x.greatest - turn.x.least), ofFoot(lab)],
    [say(names[1]), lengthText(turn.y.greatest - turn.y.least), ofFoot(lab)],
    [say('transmission'), ...worstTransmission(turn)],
  ];
  const margin = turn.isTurn ? leastMargin(linkage, turn) : null;
  if (margin) tiles.push([say('margin'), lengthText(margin[0]), say('at', turnText(margin[1]))]);
  return tiles;
}

/** Return the transmission angle that is furthest from 90 deg, and how the chart shows it. */
function worstTransmission({ angles }) {
  const folded = angles.map(({ least, greatest }) => Math.min(least, Math.PI - greatest));
  const k = folded.indexOf(Math.min(...folded));
  const { least, greatest, leastAt, greatestAt } = angles[k];
  if (least <= Math.PI - greatest)
    return [degreesText(least), say('dyadAt', k + 1, turnText(leastAt))];
  // The difference of what is shown, so that it can be checked.
  const shown = 180 - Number(((greatest * 360) / TAU).toFixed(1));
  const text = say('supplementAt', degreesText(greatest), k + 1, turnText(greatestAt));
  return [`${decimals(shown, 1)}°`, text];
}

/** Return the least clearance over the turn and where it is; null where there is none. */
function leastMargin(linkage, { pieces }) {
  let best = null;
  for (const pose of pieces.flat()) {
    for (const block of linkage.blocks) {
      const value = block.clearance(pose.u);
      if (value !== null && Number.isFinite(value) && !(best && best[0] <= value))
        best = [value < 1e-12 * linkage.size ? 0 : value, pose.x[0]];
    }
  }
  return best;
}
