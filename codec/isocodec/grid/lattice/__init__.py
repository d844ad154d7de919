"""The implicit mesh: bisection tables, domain geometry and the paged vertex store (spec clause 4)."""
