"""The benchmarks that an installation can run: time and growth beside other codes, cost and trust of every law.

`newton` measures a Newton iteration beside other codes on the same mesh in the same run, `laws` what each law costs
with each element and what its reduced models are worth. Both are the questions of `viscera bench`.
"""
