"""Drawing: polylines and surfaces from the mixed leaves of a decoded state (spec clause 9).

Arrays in, arrays out; only numpy is needed.
"""
