"""How good methods are: the field's protocol, and what it leaves out.

    found = interp.evaluate.run.evaluate(["recordings/"], "report", networks=["run/weights.safetensors"])
    found.rows, found.summary        of which a report is made, or of report/rows.csv and report/summary.json

protocol         which frames are rebuilt, when, and how they are compared
group            what is scored: sequences of groups of frames      recordings, films    where they come from
rebuilders       methods that rebuild frames                        predictions          pictures that others have made
scoring, row     from a picture to the scores of a frame            rows, summary, table what they come to
kept, worst      what is kept on disk while it goes on              run                  all of it
"""
