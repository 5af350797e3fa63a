'use strict';
/* What the page says, in English and in Portuguese. */

const TEXTS = {
  en: {
    title: 'Linkage lab',
    lead: 'Drag a joint to change lengths, drag a square to move a pivot, turn the crank.',
    language: 'Language',
    linkage: 'Linkage',
    open: 'Open a YAML file',
    opened: 'from a file',
    drawing: 'The linkage',
    drawingHint: (ofFoot) =>
      `Joints: drag, or arrow keys (with shift ten times as far). Solid: the path ${ofFoot}. Orange: an iterate of Newton-Raphson; red: where it, or a dyad, does not close.`,
    crank: 'Crank angle',
    play: 'Turn',
    pause: 'Stop',
    speed: 'Speed',
    fit: 'Fit',
    reset: 'Start again',
    undo: 'Undo',
    redo: 'Redo',
    copyLink: 'Copy link',
    practise: 'Exercises',
    linkCopied: 'The link is copied. It opens this state.',
    linkInAddress: 'The link is in the address bar. It opens this state.',
    linkTooLong: 'this file is too large for a link: save it',
    others: 'show the other assemblies',
    here: 'Here',
    closes: (angle) => `At ${angle} it closes.`,
    jams: (angle) => `At ${angle} it jams.`,
    why: 'Why it jams here',
    far: ([p, q, a, b], block, mm) =>
      `Dyad ${block} does not close: ${p} and ${q} are ${mm} further apart than ${a} + ${b}.`,
    near: ([p, q, a, b], block, mm) =>
      `Dyad ${block} does not close: ${p} and ${q} are ${mm} closer together than |${a} − ${b}|.`,
    coincide: ([p, q], block) =>
      `Dyad ${block}: ${p} and ${q} coincide, and the pose is not definite.`,
    farFromLine: ([p, q, a], block, mm) =>
      `Dyad ${block} does not close: ${p} is ${mm} further from the line of ${q} than ${a} is long.`,
    nearLine: ([p, q, a], block, mm) =>
      `Dyad ${block} does not close: ${q} is ${mm} nearer to ${p} than the line along ${a} is.`,
    open_loops: (angle) =>
      `The coupled loops do not close; the nearest angle at which they do is ${angle}.`,
    spare: (mm, block) => `${mm} to spare before dyad ${block} jams.`,
    refused: 'Refused',
    fullTurn: 'The crank turns fully.',
    period: (turns) => `It is back where it was after ${turns} turns.`,
    turnOf: (turn, turns) => `turn ${turn} of ${turns}`,
    change: (at, names, taken, left) =>
      `Change point at ${at}: ${names} in line. It goes on by its inertia, per radian of the crank: ${taken}; the other way: ${left}.`,
    freeChange: (names) => `There ${names} may also turn freely: play decides if the crank rests.`,
    coupledChange: (at, names) =>
      `Change point at ${at} of the coupled loops (${names}). It goes on by its inertia.`,
    arcs: (list) =>
      `The crank turns only from ${list}; at these ends, its dead points, a dyad is in line.`,
    grashof: (names, sl, pq, sign, kind, motion) =>
      `Grashof (${names}): s + l = ${sl} ${sign} p + q = ${pq}: class ${kind}, ${motion}.`,
    motions: {},
    stationary: (name, a, at, b, bAt) =>
      `${name} is stationary at ${a} (crank at ${at}) and ${b} (crank at ${bAt}).`,
    nowhere: 'It closes at no crank angle in this assembly.',
    and: 'and from',
    to: 'to',
    stride: 'Stride',
    lift: 'Lift',
    pathWidth: 'Width of the path',
    pathHeight: 'Height of the path',
    ofFoot: 'of the foot',
    ofCoupler: (point) => `of the coupler point ${point}`,
    ofPoint: (point) => `of the point ${point}`,
    transmission: 'Worst transmission angle',
    margin: 'Least margin',
    at: (angle) => `at ${angle}`,
    dyadAt: (k, angle) => `dyad ${k}, at ${angle}`,
    supplementAt: (greatest, k, angle) => `180° − ${greatest}, dyad ${k}, at ${angle}`,
    numbers: 'Lengths and pivots',
    bend: (what) => `bend ${what}`,
    direction: (what) => `direction ${what}`,
    chart: 'Transmission angles over a turn',
    chartHint: 'Good practice: 40° to 140°, shaded.',
    dyad: (k, least, greatest) => `dyad ${k} ${least} to ${greatest}`,
    skip: 'Skip to the values',
    print: 'Print',
    values: 'Values at this angle',
    rate: 'Crank rate [rad/s]',
    valuesHint:
      'A rate may be typed as 60 rpm. T/T: the torque of a body over the crank’s. Click a number for its curve.',
    tooFast: 'the crank rate must be within ±1,000,000 rad/s',
    body: 'Body',
    angle: 'Angle',
    velocity: 'Rate',
    acceleration: 'Acceleration',
    advantage: 'T/T crank',
    pointName: 'Point',
    dyadName: 'Transmission',
    coupled: 'coupled loops',
    curves: 'Curves',
    across: 'Over',
    addCurve: 'Add a curve',
    curvesHint: 'A click or the arrow keys turn the crank. Red: it cannot be there.',
    removeCurve: (key) => `Remove ${key}`,
    turnTable: 'A turn as a table',
    tableStep: 'Step',
    tableRates: 'rates, accelerations, advantages',
    tableCopy: 'Copy',
    tableSave: 'Save as CSV',
    tableHint: 'The columns are those of leg.table in Python.',
    tableCopied: 'Copied: paste it into a spreadsheet.',
    tableNotCopied: 'It cannot be copied here: save it.',
    assemblies: 'Assemblies at this angle',
    taken: 'drawn',
    take: 'take this',
    oneAssembly: 'It closes in no assembly at this angle.',
    newton: 'Newton-Raphson from a guess of your own',
    newtonHint: 'x(k+1) = x(k) − Φ⁻¹ f(x(k)), from the textbook’s loop equations f.',
    lecture: 'Example of SEM 104',
    fourBarLecture: 'Example of the four-bar course',
    random: 'A random guess',
    fromPose: 'From this pose',
    sem104: 'as SEM 104 prints: iterates rounded to 0.0001 rad',
    fourBar: 'as the four-bar course works: corrections of 4, 4, 6, 8 decimals [rad]',
    slips:
      'The course slips twice: it prints 72.1377 in x₄, and then subtracts 0.0000049° for 0.0000493°.',
    guess: (name, unit) => `Guess of ${name} [${unit}]`,
    iterate: 'Iterate drawn',
    iterates: 'Iterates',
    gap: 'largest |f| [mm]',
    step: (k, mark, next) => `Step ${k}: x${next} = x${mark} − Φ${mark}⁻¹ f(x${mark})`,
    equations: 'The equations',
    equationsHint:
      'L(AB) is the length of bar AB, x(D) and y(D) are a fixed pivot. Φ holds their derivatives by the angles.',
    sine: 'sin',
    converged: (count, signs, isDrawn) =>
      `Converged after ${count} correction${count === 1 ? '' : 's'}, to the assembly ${signs}${isDrawn ? ', the one drawn' : ', which is another than the one drawn'}.`,
    diverged: (count) => `Not converged after ${count} correction${count === 1 ? '' : 's'}.`,
    singular: (count) =>
      `It breaks off after ${count} correction${count === 1 ? '' : 's'}: Φ is singular there.`,
    noRoot: 'At this crank angle there is no root: it closes in no assembly.',
    path: (ofFoot) => `A path ${ofFoot.replace('of', 'for')}`,
    pathHint:
      'Draw a closed path; dashed is the present one. Save the requirements, then: design requirements.yaml. A changed linkage must be saved beside it.',
    pathPoints: 'Points, x y [mm]',
    pathMove: 'may be moved',
    pathTurn: 'may be turned',
    pathScale: 'may be scaled',
    pathStructure: 'Search',
    pathOwn: 'this linkage',
    pathNew: 'new six-bars',
    pathClear: 'Clear',
    saveRequirements: 'Save the requirements',
    noPath: 'there is no path: draw one, or write three points or more',
    save: 'Save for solver_node',
    name: 'Name',
    saveLinkage: 'Save the linkage',
    saveParameters: 'Save as parameters',
    saveHint:
      'The linkage is for the parameter linkage of solver_node; parameters are for --params-file (the lecture’s leg only).',
    text: 'The text of the file',
    loadText: 'Load this text',
    nothingToSave: 'nothing is saved: it closes at no crank angle',
    tooLong: (size) => `the file has ${size} bytes, more than a million`,
    unreadable: 'the file cannot be read',
    noNumber: (text) => `${text} is not a number`,
    noUnit: (text, units) => `${text} is no unit here: write a number alone, or with ${units}`,
    wrongSeparator: (text) => `${text} is not a number: write a decimal point, as in 12.5`,
    point: (name) => `Point ${name}: the arrow keys move it`,
    side: 'it cannot be dragged through its own bar',
  },
  pt: {
    title: 'Laboratório de mecanismos',
    lead: 'Arraste uma junta para mudar comprimentos, um quadrado para mover uma articulação fixa, e gire a manivela.',
    language: 'Idioma',
    linkage: 'Mecanismo',
    open: 'Abrir um arquivo YAML',
    opened: 'de um arquivo',
    drawing: 'O mecanismo',
    drawingHint: (ofFoot) =>
      `Juntas: arraste, ou use as setas (com shift, dez vezes mais). Linha cheia: a trajetória ${ofFoot}. Laranja: uma iteração de Newton-Raphson; vermelho: onde ela, ou uma díade, não fecha.`,
    crank: 'Ângulo da manivela',
    play: 'Girar',
    pause: 'Parar',
    speed: 'Velocidade',
    fit: 'Enquadrar',
    reset: 'Recomeçar',
    undo: 'Desfazer',
    redo: 'Refazer',
    copyLink: 'Copiar link',
    practise: 'Exercícios',
    linkCopied: 'O link foi copiado. Ele abre este estado.',
    linkInAddress: 'O link está na barra de endereço. Ele abre este estado.',
    linkTooLong: 'este arquivo é grande demais para um link: salve-o',
    others: 'mostrar as outras montagens',
    here: 'Aqui',
    closes: (angle) => `Em ${angle} o mecanismo fecha.`,
    jams: (angle) => `Em ${angle} o mecanismo trava.`,
    why: 'Por que trava aqui',
    far: ([p, q, a, b], block, mm) =>
      `A díade ${block} não fecha: ${p} e ${q} estão ${mm} mais afastados do que ${a} + ${b}.`,
    near: ([p, q, a, b], block, mm) =>
      `A díade ${block} não fecha: ${p} e ${q} estão ${mm} mais próximos do que |${a} − ${b}|.`,
    coincide: ([p, q], block) =>
      `Díade ${block}: ${p} e ${q} coincidem, e a posição fica indefinida.`,
    farFromLine: ([p, q, a], block, mm) =>
      `A díade ${block} não fecha: ${p} está ${mm} mais longe da reta de ${q} do que o comprimento de ${a}.`,
    nearLine: ([p, q, a], block, mm) =>
      `A díade ${block} não fecha: ${q} está ${mm} mais perto de ${p} do que a reta ao longo de ${a}.`,
    open_loops: (angle) =>
      `As malhas acopladas não fecham; o ângulo mais próximo em que fecham é ${angle}.`,
    spare: (mm, block) => `Margem de ${mm} até a díade ${block} travar.`,
    refused: 'Recusado',
    fullTurn: 'A manivela dá a volta completa.',
    period: (turns) => `O mecanismo volta ao início após ${turns} voltas.`,
    turnOf: (turn, turns) => `volta ${turn} de ${turns}`,
    change: (at, names, taken, left) =>
      `Ponto de mudança em ${at}: ${names} alinhados. O mecanismo segue por inércia, por radiano da manivela: ${taken}; o outro caminho: ${left}.`,
    freeChange: (names) =>
      `Ali ${names} também podem girar livremente: se a manivela parar, as folgas decidem.`,
    coupledChange: (at, names) =>
      `Ponto de mudança em ${at} das malhas acopladas (${names}). O mecanismo segue por inércia.`,
    arcs: (list) =>
      `A manivela gira só de ${list}; nesses extremos, os pontos mortos, uma díade fica alinhada.`,
    grashof: (names, sl, pq, sign, kind, motion) =>
      `Grashof (${names}): s + l = ${sl} ${sign} p + q = ${pq}: classe ${kind}, ${motion}.`,
    motions: {
      'crank-rocker': 'manivela-balancim',
      'rocker-crank': 'balancim-manivela',
      'double crank': 'dupla manivela',
      'double rocker': 'duplo balancim',
      'triple rocker': 'triplo balancim',
    },
    stationary: (name, a, at, b, bAt) =>
      `${name} fica estacionário em ${a} (manivela em ${at}) e ${b} (manivela em ${bAt}).`,
    nowhere: 'Nesta montagem o mecanismo não fecha em nenhum ângulo da manivela.',
    and: 'e de',
    to: 'a',
    stride: 'Passada',
    lift: 'Elevação',
    pathWidth: 'Largura da trajetória',
    pathHeight: 'Altura da trajetória',
    ofFoot: 'do pé',
    ofCoupler: (point) => `do ponto ${point} da biela`,
    ofPoint: (point) => `do ponto ${point}`,
    transmission: 'Pior ângulo de transmissão',
    margin: 'Menor margem',
    at: (angle) => `em ${angle}`,
    dyadAt: (k, angle) => `díade ${k}, em ${angle}`,
    supplementAt: (greatest, k, angle) => `180° − ${greatest}, díade ${k}, em ${angle}`,
    numbers: 'Comprimentos e articulações fixas',
    bend: (what) => `ângulo ${what}`,
    direction: (what) => `direção ${what}`,
    chart: 'Ângulos de transmissão numa volta',
    chartHint: 'Boa prática: 40° a 140°, faixa sombreada.',
    dyad: (k, least, greatest) => `díade ${k} ${least} a ${greatest}`,
    skip: 'Ir para os valores',
    print: 'Imprimir',
    values: 'Valores neste ângulo',
    rate: 'Velocidade da manivela [rad/s]',
    valuesHint:
      'A velocidade pode ser 60 rpm. T/T: o torque de um corpo sobre o da manivela. Clique num número para ver a curva.',
    tooFast: 'a velocidade da manivela tem de estar entre ±1.000.000 rad/s',
    body: 'Corpo',
    angle: 'Ângulo',
    velocity: 'Velocidade',
    acceleration: 'Aceleração',
    advantage: 'T/T manivela',
    pointName: 'Ponto',
    dyadName: 'Transmissão',
    coupled: 'malhas acopladas',
    curves: 'Curvas',
    across: 'Em função de',
    addCurve: 'Mais uma curva',
    curvesHint: 'Um clique ou as setas giram a manivela. Vermelho: ela não chega lá.',
    removeCurve: (key) => `Retirar ${key}`,
    turnTable: 'Uma volta em tabela',
    tableStep: 'Passo',
    tableRates: 'velocidades, acelerações, vantagens',
    tableCopy: 'Copiar',
    tableSave: 'Salvar em CSV',
    tableHint:
      'As colunas são as de leg.table em Python. O CSV abre no Excel brasileiro: vírgula decimal, ponto e vírgula.',
    tableCopied: 'Copiada: cole numa planilha.',
    tableNotCopied: 'Não é possível copiar aqui: salve em CSV.',
    assemblies: 'Montagens neste ângulo',
    taken: 'desenhada',
    take: 'usar esta',
    oneAssembly: 'Neste ângulo o mecanismo não fecha em nenhuma montagem.',
    newton: 'Newton-Raphson a partir do seu chute inicial',
    newtonHint: 'x(k+1) = x(k) − Φ⁻¹ f(x(k)), com as equações de posição f da aula.',
    lecture: 'Exemplo de SEM 104',
    fourBarLecture: 'Exemplo do curso de quatro barras',
    random: 'Um chute aleatório',
    fromPose: 'Desta posição',
    sem104: 'como SEM 104 imprime: iterações arredondadas a 0,0001 rad',
    fourBar:
      'como o curso de quatro barras calcula: correções com 4, 4, 6, 8 casas decimais [rad]',
    slips:
      'O curso erra duas vezes: imprime 72,1377 em x₄, e depois subtrai 0,0000049° em vez de 0,0000493°.',
    guess: (name, unit) => `Chute inicial de ${name} [${unit}]`,
    iterate: 'Iteração desenhada',
    iterates: 'Iterações',
    gap: 'maior |f| [mm]',
    step: (k, mark, next) => `Passo ${k}: x${next} = x${mark} − Φ${mark}⁻¹ f(x${mark})`,
    equations: 'As equações',
    equationsHint:
      'L(AB) é o comprimento da barra AB, x(D) e y(D) são de uma articulação fixa. Φ contém as derivadas em relação aos ângulos.',
    sine: 'sen',
    converged: (count, signs, isDrawn) =>
      `Convergiu após ${count} ${count === 1 ? 'correção' : 'correções'}, para a montagem ${signs}${isDrawn ? ', a desenhada' : ', que não é a desenhada'}.`,
    diverged: (count) => `Não convergiu após ${count} ${count === 1 ? 'correção' : 'correções'}.`,
    singular: (count) =>
      `Interrompido após ${count} ${count === 1 ? 'correção' : 'correções'}: ali Φ é singular.`,
    noRoot: 'Neste ângulo da manivela não há raiz: o mecanismo não fecha em nenhuma montagem.',
    path: (ofFoot) => `Uma trajetória ${ofFoot.replace('do', 'para o')}`,
    pathHint:
      'Desenhe uma trajetória fechada; tracejada está a atual. Salve os requisitos, depois: design requirements.yaml. Um mecanismo alterado tem de ser salvo ao lado.',
    pathPoints: 'Pontos, x y [mm]',
    pathMove: 'pode ser movida',
    pathTurn: 'pode ser girada',
    pathScale: 'pode ser escalada',
    pathStructure: 'Procurar',
    pathOwn: 'este mecanismo',
    pathNew: 'novos de seis barras',
    pathClear: 'Limpar',
    saveRequirements: 'Salvar os requisitos',
    noPath: 'não há trajetória: desenhe uma, ou escreva três pontos ou mais',
    save: 'Salvar para o solver_node',
    name: 'Nome',
    saveLinkage: 'Salvar o mecanismo',
    saveParameters: 'Salvar como parâmetros',
    saveHint:
      'O mecanismo é para o parâmetro linkage do solver_node; parâmetros são para --params-file (só a perna da aula).',
    text: 'O texto do arquivo',
    loadText: 'Carregar este texto',
    nothingToSave: 'nada foi salvo: o mecanismo não fecha em nenhum ângulo da manivela',
    tooLong: (size) => `o arquivo tem ${size} bytes, mais de um milhão`,
    unreadable: 'o arquivo não pode ser lido',
    noNumber: (text) => `${text} não é um número`,
    noUnit: (text, units) => `${text} não serve de unidade aqui: use só o número, ou ${units}`,
    wrongSeparator: (text) => `${text} não é um número: use a vírgula decimal, como em 12,5`,
    point: (name) => `Ponto ${name}: as setas o movem`,
    side: 'não pode ser arrastado através da sua própria barra',
  },
};

// The shipped linkages' names; those of files are as they are.
const TITLES = {
  andrews: 'Mecanismo de Andrews',
  chebyshev: 'Mecanismo de Chebyshev',
  chebyshev_lambda: 'Mecanismo lambda de Chebyshev',
  four_bar: 'Mecanismo de quatro barras da aula',
  galloway: 'Mecanismo de Galloway',
  ghassaei: 'Perna de Ghassaei',
  hoecken: 'Mecanismo de Hoecken',
  jansen: 'Perna de Jansen',
  klann: 'Perna de Klann (SEM 104)',
  klann_high_step: 'Perna de Klann, passo alto',
  klann_lego: 'Perna de Klann, de LEGO',
  klann_long_legs: 'Perna de Klann, longa',
  klann_patent: 'Perna de Klann, da patente',
  parallelogram: 'Perna de paralelogramo',
  peaucellier: 'Mecanismo de Peaucellier-Lipkin',
  quick_return: 'Retorno rápido',
  roberts: 'Mecanismo de Roberts',
  scotch_yoke: 'Garfo escocês',
  side_rod: 'Rodas acopladas por bielas',
  slider_crank: 'Biela-manivela',
  stephenson: 'Seis barras de Stephenson III',
  strider: 'Perna Strider',
  trotbot: 'Perna TrotBot',
  walker_four_bar: 'Quatro barras que anda',
  walker_six_bar: 'Seis barras que anda',
  watt_six_bar: 'Seis barras de Watt',
};

const language = {
  now: (navigator.language || 'en').toLowerCase().startsWith('pt') ? 'pt' : 'en',
};

/** Return a text in the page's language; of some, with what they tell of. */
function say(key, ...what) {
  const text = TEXTS[language.now][key];
  return typeof text === 'function' ? text(...what) : text;
}

/** Put the texts into all elements that name one. */
function translate() {
  document.documentElement.lang = language.now === 'pt' ? 'pt-BR' : 'en';
  document.title = say('title');
  for (const node of document.querySelectorAll('[data-text]'))
    node.textContent = say(node.dataset.text);
  for (const node of document.querySelectorAll('[data-label]'))
    node.setAttribute('aria-label', say(node.dataset.label));
}

function decimals(value, digits) {
  const shown = Object.is(Number(value.toFixed(digits)), -0) ? 0 : value;
  return inLocale(shown.toFixed(digits));
}

function inLocale(text) {
  return (language.now === 'pt' ? text.replace('.', ',') : text).replaceAll('-', '\u2212');
}

function degreesText(angle, digits = 1) {
  return `${decimals((angle * 360) / TAU, digits)}°`;
}

function turnText(angle, digits = 1) {
  return degreesText(((angle % TAU) + TAU) % TAU, digits);
}

/** Return a length in mm, with as many digits as tell something. */
function lengthText(metres) {
  const mm = 1000 * metres;
  const size = Math.abs(mm);
  if (size && (size < 1e-3 || size >= 1e6)) return `${inLocale(mm.toExponential(2))} mm`;
  return `${decimals(mm, !size || size >= 10 ? 1 : size < 0.1 ? 4 : 2)} mm`;
}

function signsText(signs) {
  return `[${signs.map((sign) => (sign > 0 ? '+' : '\u2212')).join(' ')}]`;
}
