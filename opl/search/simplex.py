"""The simplex method on a dictionary: few variables, and rows that come while it goes on.

A dictionary (Chvatal, Linear Programming, 1983) has the objective in its first row and a basic
variable in each other one: a constant, and what each of the other variables, which are 0, adds to
it. All variables are at least 0. Names below the number of factors of a row are those of the
variables that rows are given in; others are those of the rows.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

MOST_PIVOTS = 400  # at once
ENTERS = 1e-10  # gain below which a variable stays 0
PIVOT = 1e-9  # smallest that is divided by
KEPT = -1e-12  # least value of a row that counts as kept


@kernel("int64(float64[:,::1],int64[::1],int64[::1],int64,float64[::1],float64,int64)")
def take_in(table, basic, others, n_rows, factors, constant, name):  # type: ignore[no-untyped-def]
    """Add a row, a constant and factors times the variables; return how many there are then.

    Args:
        table: The dictionary, with room for another row.
        basic: Name of the variable of each row, the objective aside.
        others: Name of the variable of each column, the constants aside.
        n_rows: How many rows there are, the objective aside.
        factors: Of each variable.
        constant: The constant.
        name: That of the row.
    """
    row = n_rows + 1
    table[row] = 0.0
    table[row, 0] = constant
    for j in range(len(others)):
        if others[j] < len(factors):
            table[row, 1 + j] += factors[others[j]]
    for i in range(n_rows):
        if basic[i] < len(factors) and factors[basic[i]] != 0.0:
            for j in range(len(others) + 1):
                table[row, j] += factors[basic[i]] * table[1 + i, j]
    basic[n_rows] = name
    return row


@kernel("int64(float64[:,::1],int64[::1],int64[::1],int64,boolean)")
def pivoted(table, basic, others, n_rows, dual):  # type: ignore[no-untyped-def]
    """Bring a dictionary to its optimum; return how many steps that took.

    The dual method begins where no variable gains but some rows are not kept, the primal one the
    other way about. What they are given is as of `take_in`.
    """
    for step in range(MOST_PIVOTS):
        enter, leave, least = -1, -1, np.inf
        if dual:
            worst = KEPT
            for row in range(1, n_rows + 1):
                if table[row, 0] < worst:
                    leave, worst = row, table[row, 0]
            if leave < 0:
                return step
            for j in range(1, len(others) + 1):
                if table[leave, j] > PIVOT and -table[0, j] / table[leave, j] < least:
                    enter, least = j, -table[0, j] / table[leave, j]
        else:
            most = ENTERS
            for j in range(1, len(others) + 1):
                if table[0, j] > most:
                    enter, most = j, table[0, j]
            if enter < 0:
                return step
            for row in range(1, n_rows + 1):
                if table[row, enter] < -PIVOT and -table[row, 0] / table[row, enter] < least:
                    leave, least = row, -table[row, 0] / table[row, enter]
        if enter < 0 or leave < 0:
            return step
        divisor = table[leave, enter]
        for j in range(len(others) + 1):
            table[leave, j] /= -divisor
        table[leave, enter] = 1.0 / divisor
        for row in range(n_rows + 1):
            factor = table[row, enter]
            if row != leave and factor != 0.0:
                table[row, enter] = 0.0
                for j in range(len(others) + 1):
                    table[row, j] += factor * table[leave, j]
        basic[leave - 1], others[enter - 1] = others[enter - 1], basic[leave - 1]
    return MOST_PIVOTS
