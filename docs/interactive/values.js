'use strict';
/* Numbers below a drawing: each function returns rows of a name and a text. */

function angleText(angle) {
  return degreesText(angle, 2);
}

function turnsText(count) {
  const isOne = count === 1;
  return `${count} ${translated({ en: isOne ? 'turn' : 'turns', pt: isOne ? 'volta' : 'voltas' })}`;
}

const VALUES = {
  angles: ({ linkage, pose }) =>
    pose.error
      ? []
      : linkage.structure.bodies.flatMap((body, j) =>
          j && !body.slides ? [[angleLetter(body.name), angleText(pose.x[j])]] : [],
        ),

  foot: ({ linkage, pose, turn }) =>
    pose.error
      ? []
      : [
          [
            linkage.structure.foot,
            `(${pose.points[turn.foot].map((v) => decimals(1000 * v, 1)).join('; ')}) mm`,
          ],
        ],

  transmission: ({ linkage, pose }) =>
    pose.error
      ? []
      : linkage.blocks.map((block, k) => [
          linkage.blocks.length > 1 ? `μ${'₁₂₃₄₅'[k]}` : 'μ',
          angleText(block.transmissionAngle(pose.u)),
        ]),

  extremes: ({ turn }) => {
    const [{ least, greatest }] = turn.angles;
    if (least > greatest) return [];
    return [
      [
        translated({ en: 'μ over the turn', pt: 'μ na volta' }),
        `${degreesText(least)} … ${degreesText(greatest)}`,
      ],
    ];
  },

  condition: ({ linkage, pose }) =>
    pose.error ? [] : [['cond Φ', decimals(conditionOf(linkage.equations(pose.x).phi), 2)]],

  velocity: ({ linkage, pose, turn }) => {
    const velocity = pose.error ? null : velocityOf(linkage, pose, turn.foot);
    return velocity
      ? [
          [
            `d${linkage.structure.foot}/dα`,
            `(${velocity.map((v) => decimals(v, 4)).join('; ')}) m/rad`,
          ],
        ]
      : [];
  },

  torque: ({ linkage, pose, turn, state }) => {
    const velocity = pose.error ? null : velocityOf(linkage, pose, turn.foot);
    if (!velocity) return [];
    const force = C.polar(FORCE, state.force * DEGREE);
    const torque = -(force[0] * velocity[0] + force[1] * velocity[1]);
    return [[translated({ en: 'T for 100 N', pt: 'T para 100 N' }), `${decimals(torque, 2)} N·m`]];
  },

  extent: ({ turn }) =>
    turn.x.least > turn.x.greatest
      ? []
      : [
          [
            translated({ en: 'stride', pt: 'passada' }),
            lengthText(turn.x.greatest - turn.x.least),
          ],
          [translated({ en: 'lift', pt: 'elevação' }), lengthText(turn.y.greatest - turn.y.least)],
        ],

  stance: (figure) => {
    const stance = stanceOf(figure);
    if (!stance) return [];
    const start = ((stance.start % TAU) + TAU) % TAU;
    const span = stance.end - stance.start;
    return [
      [
        translated({ en: 'stance', pt: 'apoio' }),
        `${angleText(start)} … ${angleText(start + span)}`,
      ],
      [translated({ en: 'duty factor', pt: 'fator de apoio' }), decimals(span / TAU, 3)],
    ];
  },

  dyad: (figure) => {
    const { d, r, s, a, p, joints, middle } = dyadCircles(figure);
    const h = C.abs(C.sub(joints[0], middle));
    return [
      ['d', lengthText(d)],
      ['a', lengthText(a)],
      ['h', Number.isFinite(h) ? lengthText(h) : '–'],
      [
        translated({ en: 'reach', pt: 'alcance' }),
        `${lengthText(Math.abs(r - s))} … ${lengthText(r + s)}`,
      ],
    ];
  },

  diagonal: (figure) => [['Z', lengthText(dyadCircles(figure).d)]],

  grashof: ({ linkage }) => {
    const { kind, motion } = grashofOf(fourBarOf(linkage).lengths);
    return [['Grashof', kind ? `${kind}, ${say('motions')[motion] || motion}` : '–']];
  },

  reach: ({ turn }) => {
    const text = turn.isTurn
      ? translated({ en: 'the whole turn', pt: 'a volta toda' })
      : turn.arcs.map((arc) => arc.map((end) => degreesText(end)).join(' … ')).join(', ') || '–';
    return [[translated({ en: 'crank', pt: 'manivela' }), text]];
  },

  corrections: (figure) => {
    const { x, converged } = iteratesOf(figure);
    const { linkage } = figure;
    if (!converged) return [['', translated({ en: 'does not converge', pt: 'não converge' })]];
    const u = linkage.vectors(x.at(-1));
    const signs = linkage.blocks.map((block) => (block.sine(u) < 0 ? -1 : 1));
    return [
      [translated({ en: 'corrections', pt: 'correções' }), String(x.length - 1)],
      [translated({ en: 'assembly', pt: 'montagem' }), signsText(signs)],
    ];
  },

  iterate: (figure) => {
    const { x, residuals } = iteratesOf(figure);
    const k = Math.min(figure.state.iterate, x.length);
    const rows = figure.linkage.structure.angles
      .slice(1)
      .map((name, i) => [angleLetter(name), degreesText(x[k - 1][i + 1], 4)]);
    const residual = 1000 * residuals[k - 1];
    return [
      ...rows,
      [
        translated({ en: 'largest |f|', pt: 'maior |f|' }),
        `${inLocale(residual.toExponential(1))} mm`,
      ],
    ];
  },

  warm: (figure) => {
    const names = {
      last: { en: 'from the last pose', pt: 'da última posição' },
      tangent: { en: 'from its tangent', pt: 'da tangente' },
    };
    const text = ({ count, converged, isRight }) => {
      if (isRight) return translated({ en: `${count} corrections`, pt: `${count} correções` });
      return converged
        ? translated({ en: 'another assembly', pt: 'outra montagem' })
        : translated({ en: 'no pose', pt: 'nenhuma posição' });
    };
    return (warmStarts(figure) || []).map((start) => [translated(names[start.name]), text(start)]);
  },

  structure: ({ linkage }) => {
    const sizes = linkage.blocks.map(({ unknowns }) => unknowns.length);
    const text = sizes.every((size) => size === 2)
      ? translated({ en: 'dyads', pt: 'díades' })
      : translated({ en: 'coupled loops', pt: 'malhas acopladas' });
    return [
      [
        translated({ en: 'unknowns of each block', pt: 'incógnitas de cada bloco' }),
        `${sizes.join(' + ')} (${text})`,
      ],
    ];
  },

  change: ({ linkage, pose }) => {
    const rates = pose.error ? null : ratesOf(linkage, pose);
    const [crank, ...names] = linkage.structure.angles.map(angleLetter);
    const period = linkage.changes.period;
    return [
      ...(rates ? [[`d${names.at(-1)}/d${crank}`, decimals(rates.at(-1), 3)]] : []),
      [translated({ en: 'back after', pt: 'volta ao início após' }), turnsText(period)],
    ];
  },

  cloud: (figure) => {
    const cloud = cloudOf(figure);
    const turning = cloud.filter(Boolean).length;
    const ideal = Array.from(
      { length: CLOUD_ANGLES },
      (_, k) => poseAt(figure.linkage, (k * TAU) / CLOUD_ANGLES).points[figure.turn.foot],
    );
    const distances = cloud
      .filter(Boolean)
      .map((path) => Math.max(...path.map((point, k) => C.abs(C.sub(point, ideal[k])))))
      .sort((a, b) => a - b);
    const bound = distances[Math.floor(0.95 * (distances.length - 1))];
    return [
      [translated({ en: 'turn fully', pt: 'giram a volta toda' }), `${turning} / ${CLOUD_SIZE}`],
      [translated({ en: 'foot of 95 % within', pt: 'pé de 95 % dentro de' }), lengthText(bound)],
    ];
  },

  timeRatio: (figure) => {
    const ratio = figure.once('time ratio', () => {
      const { leastAt, greatestAt } = figure.turn.x;
      const forth = (((greatestAt - leastAt) % TAU) + TAU) % TAU;
      return Math.max(forth, TAU - forth) / Math.min(forth, TAU - forth);
    });
    const { greatest, least } = figure.turn.x;
    return [
      [translated({ en: 'stroke', pt: 'curso' }), lengthText(greatest - least)],
      [translated({ en: 'time ratio', pt: 'razão de tempo' }), decimals(ratio, 3)],
    ];
  },
};
