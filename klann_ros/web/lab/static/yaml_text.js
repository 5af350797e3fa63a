'use strict';
/* Content written as YAML. */

/** Return content as YAML: what is short in one line, in brackets, the rest in blocks. */
function writeYaml(content, indent = '') {
  return Object.entries(content)
    .map(([key, value]) => `${indent}${key}:${yamlBelow(value, indent)}`)
    .join('');
}

function yamlBelow(value, indent) {
  const flat = yamlFlow(value);
  if (value === null || typeof value !== 'object' || flat.length + indent.length < 70)
    return ` ${flat}\n`;
  if (Array.isArray(value))
    return `\n${value.map((item) => `${indent}  - ${yamlFlow(item)}\n`).join('')}`;
  return `\n${writeYaml(value, `${indent}  `)}`;
}

function yamlFlow(value) {
  if (value === null || typeof value === 'boolean') return String(value);
  if (typeof value === 'number') return String(value);
  if (typeof value === 'string') return yamlText(value);
  if (Array.isArray(value)) return `[${value.map(yamlFlow).join(', ')}]`;
  return `{${Object.entries(value)
    .map(([key, item]) => `${key}: ${yamlFlow(item)}`)
    .join(', ')}}`;
}

function yamlText(text) {
  const isPlain = /^[A-Za-z][A-Za-z0-9_]*$/.test(text);
  if (isPlain && !TRUE.test(text) && !FALSE.test(text) && !/^null$/i.test(text)) return text;
  const escaped = (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, '0')}`;
  return JSON.stringify(text).replace(/[\x7f-\xa0\u2028\u2029\ufeff\ufffe\uffff]/g, escaped);
}
