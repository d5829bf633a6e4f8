"""How the functions share a process: with other threads, and with Ctrl-C."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import unittest
from concurrent.futures import ThreadPoolExecutor

import rotorlead
from stand import Stand


def headline(folder):
    return rotorlead.identify(folder).headline


class Process(Stand):
    def test_other_threads_run_meanwhile(self):
        count, is_done = 0, threading.Event()

        def work():
            nonlocal count
            while not is_done.is_set():
                count += 1

        for function in (
            lambda: rotorlead.simulate("motor.toml", seed=1),
            lambda: rotorlead.identify("sim"),
            lambda: rotorlead.diagnose("real"),
        ):
            is_done.clear()
            other = threading.Thread(target=work)
            other.start()
            before, start = count, time.perf_counter()
            function()
            taken, meanwhile = time.perf_counter() - start, count - before
            is_done.set()
            other.join()
            # With the lock held the other thread gets no turn. It counts millions per second.
            self.assertGreater(meanwhile, 10_000 * taken)

    def test_threads_give_what_one_gives(self):
        alone = [rotorlead.simulate("motor.toml", "plan.toml", seed=seed) for seed in range(4)]
        with ThreadPoolExecutor() as pool:
            beside = list(pool.map(lambda seed: rotorlead.simulate("motor.toml", "plan.toml", seed=seed), range(4)))
        for one, other in zip(alone, beside):
            self.assert_same(rotorlead.identify(one).to_dict(), rotorlead.identify(other).to_dict())

    @unittest.skipUnless("fork" in multiprocessing.get_all_start_methods(), "this system does not fork")
    def test_processes_that_are_forked_after_a_call_compute_too(self):
        alone = headline("sim")
        with multiprocessing.get_context("fork").Pool(2) as pool:
            self.assertEqual(pool.map_async(headline, ["sim"] * 2).get(timeout=120), [alone] * 2)

    def test_a_system_without_threads_to_give_raises_an_exception(self):
        code = "import rotorlead\ntry: rotorlead.identify('sim')\nexcept Exception as error: print(type(error).__name__, error)"
        # Each thread asks for room that there is not.
        environment = {**os.environ, "RUST_MIN_STACK": "1000000000000000"}
        ended = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        self.assertIn("OSError no thread can be started", ended.stdout, ended.stderr)

    def test_ctrl_c_is_answered_within_100_ms(self):
        # In a process of its own, which is ended where it hangs; its clock is that of this one.
        code = (
            "import rotorlead, signal, sys, time\n"
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
            "records = rotorlead.Records.read('sim')\n"
            "print('ready', flush=True)\n"
            "try:\n"
            "    while True: rotorlead.diagnose(records)\n"
            "except KeyboardInterrupt:\n"
            "    print(time.monotonic(), flush=True)\n"
        )
        waited = []
        for _ in range(3):
            with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
                ended = threading.Timer(60, process.kill)
                ended.start()
                self.assertEqual(process.stdout.readline(), "ready\n")
                time.sleep(0.2)
                start = time.monotonic()
                process.send_signal(signal.SIGINT)
                waited.append(float(process.stdout.readline()) - start)
                process.kill()
                ended.cancel()
        # The shortest: another process may have had the core.
        self.assertLess(min(waited), 0.1, waited)
