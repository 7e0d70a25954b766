"""A client of loadtest/batches/run: prints a line of JSON for each answer as it arrives.

Usage: client.py plain|asyncio batch|array ADDRESSES PROBLEMS
"""

import asyncio
import json
import sys

import marble
import marble.aio
from problems import BASE, change, problem

kind, way, addresses, count = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])


def emit(**line):
    print(json.dumps(line), flush=True)


def report(answer):
    if answer.error is None:
        emit(index=answer.index, objective=answer.solution.objective, z=list(answer.solution.z))
    else:
        emit(index=answer.index, error=repr(answer.error))


def changes():
    for index in range(count):
        yield change(index)
    emit(event="uploading")  # all are encoded


def problems():
    return (problem(index) for index in range(count))


def plain():
    with marble.Client(addresses) as client:
        client.info()
        if way == "batch":
            answers = client.batch(problems())
        else:
            job = client.jobs.submit_array(changes(), base=BASE).job_id
            emit(event="accepted", job=job)
            answers = client.jobs.array(job)
        for answer in answers:
            report(answer)


async def with_asyncio():
    async with marble.aio.Client(addresses) as client:
        await client.info()
        if way == "batch":
            answers = client.batch(problems())
        else:
            job = (await client.jobs.submit_array(changes(), base=BASE)).job_id
            emit(event="accepted", job=job)
            answers = client.jobs.array(job)
        async for answer in answers:
            report(answer)


plain() if kind == "plain" else asyncio.run(with_asyncio())
