"""What a log says about the instrument that wrote it: geometry, closure, defects, mounting; said in words.

Order of the modules: `logs` reads, `robust` fits, `matrix`, `closure`, `orders`, `defects` and `mounting` judge one
thing each, `findings` puts it into words, `examine` runs them all, `figures` and `page` show the result.
"""
