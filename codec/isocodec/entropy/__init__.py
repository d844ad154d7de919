"""Binary adaptive range coder and the baseline models (spec clauses 6 and 7). Knows nothing of geometry."""
