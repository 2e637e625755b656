"""The programs that are compared, a module for each library.

Each module has ``PROGRAMS``: name -> a class that takes ``(problem, precision, threads)`` and has
``run(steps)``, which returns when the steps are done, and ``positions()``, the masses' places
(N, M, 3) as float64. A class may say ``most_threads`` that it can use, ``precisions`` that it has,
and how its physics ``differs``: then it is checked in free flight, where all must agree. And
``versions()``: name -> version of what it stands on.
"""
