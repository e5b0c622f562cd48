"""How good methods are: the field's protocol, and what it leaves out.

    found = interp.evaluate.run.evaluate(["recordings/"], "report", networks=["run/weights.safetensors"])
    found.rows, found.summary        and in the folder report.html, report.md, rows.csv, summary.json, worst/

protocol         which frames are rebuilt, when, and how they are compared
group            what is scored: sequences of groups of frames      recordings, films    where they come from
rebuilders       methods that rebuild frames                        predictions          pictures that others have made
scoring, row     from a picture to the scores of a frame            tables, conditions   means, extremes, bins
rows, summary    rows and what they come to, on disk                report, figures      the same for people
kept, worst      what is kept on disk while it goes on              remarks              what was left out
run              all of it
"""
