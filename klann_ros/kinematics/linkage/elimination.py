"""Gauss's elimination as straight-line code."""


def elimination(n: int) -> list[str]:
    """Return a function that solves n equations by Gauss's elimination with row pivots."""
    rows = [[f'm{i}_{j}' for j in range(n)] + [f'b{i}'] for i in range(n)]
    given = ', '.join([*(name for row in rows for name in row[:-1]), *(row[-1] for row in rows)])
    lines = [f'def solve{n}({given}):', '    det = 1.0']
    failed = ', '.join(['0.0'] * (n + 1))
    for k in range(n):
        for i in range(k + 1, n):
            ours, theirs = ', '.join(rows[k][k:]), ', '.join(rows[i][k:])
            lines += [
                f'    if abs({rows[i][k]}) > abs({rows[k][k]}):',
                f'        {ours}, {theirs} = {theirs}, {ours}',
                '        det = -det',
            ]
        lines += [f'    if {rows[k][k]} == 0.0:', f'        return {failed}']
        lines += [f'    det *= {rows[k][k]}']
        for i in range(k + 1, n):
            lines += [f'    t = {rows[i][k]} / {rows[k][k]}']
            for j in range(k + 1, n + 1):
                lines += [f'    {rows[i][j]} -= t * {rows[k][j]}']
    for k in reversed(range(n)):
        known = ''.join(f' - {rows[k][j]} * {rows[j][n]}' for j in range(k + 1, n))
        lines += [f'    b{k} = (b{k}{known}) / {rows[k][k]}']
    return [*lines, f'    return det, {", ".join(f"b{k}" for k in range(n))}']
