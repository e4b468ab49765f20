"""What an example of an engine shall let a hand feel: a box presses, slides, pushes, lifts and enters a hole.

A subclass, which is also a unittest.TestCase, has `play(scene, seconds, hand, *options, rate=60, stall=0)`, which
returns the ticks with force on and where the body was every half second, m. stall: see hand_session.run().
"""

from hand_session import extremes, in_some_attempt, largest_jump, mean, on_time, push, reach

STIFFNESS = 4000  # N/m, of each contact: the server's default
GRAVITY = 9.81  # m/s²
SERVO_RATE = 1000  # Hz
PRINTED = 0.5  # s, from line to line of an example


class TouchTasks:
    rates = (60,)  # Hz, of frames, at which it slides, pushes and lifts
    stalls = (0.03, 0.1, 0.3)  # s, of its world
    largest_jump = 0.15  # N, at rest
    largest_jump_of_bodies = 0.15  # N
    largest_deviation_of_brick = 0.1  # N
    largest_deviation_of_load = 0.01  # N, of a body that is carried
    largest_error_after_stall = 1.5  # N
    friction_of_brick = 0.4
    error_of_friction = 0.01  # of the friction of a box that slides
    error_of_brick = 0.05     # of the friction of a body that is pushed
    error_of_momentum = 0.05  # of the momentum that a body gains
    error_of_weight = 0.03    # of the weight of a body that is lifted

    @staticmethod
    def tell(what, is_, due):
        print(f"{what}: {is_:.4f}, due {due:.4f}, {100 * (is_ / due - 1):+.2f} %", flush=True)

    def rests(self, ticks, column, force, begin, end):
        """It is that force, N, still, and updates change nothing."""
        mean_force, deviation = mean(ticks, column, begin, end)
        self.assertAlmostEqual(mean_force, force, delta=0.01)
        self.assertLess(deviation, 0.01)
        self.assertLess(largest_jump(ticks, begin, end), self.largest_jump)

    def test_a_box_that_is_pressed_on_the_table_rests_on_its_four_corners(self):
        for stiffness in (4e3, 16e3, 50e3):
            for rate in (30, 60, 500):
                with self.subTest(stiffness=stiffness, rate=rate):
                    ticks, _ = self.play("table", 2.5, reach(0.5, 0, 0.018) + push(3, 0, -2),
                                         "--stiffness", str(stiffness), rate=rate)
                    self.rests(ticks, "env_force_z_N", 2, 1.2, 1.7)
                    depth = 2 / (4 * stiffness)
                    self.tell(f"presses {stiffness:.0f} N/m at {rate} Hz, depth, um",
                              1e6 * (0.02 - mean(ticks, "proxy_z_m", 1.2, 1.7)[0]), 1e6 * depth)
                    self.assertAlmostEqual(0.02 - mean(ticks, "proxy_z_m", 1.2, 1.7)[0], depth, delta=0.02 * depth)

    def test_a_box_that_slides_on_the_table_feels_the_friction_of_both(self):
        for rate in self.rates:
            with self.subTest(rate=rate):
                ticks, _ = self.play("table", 4.5, reach(0.5, 0, 0.021) + push(0.5, 0, -2)
                                     + "[[segment]]\nduration = 2\nmove_to = { position = [0.1, 0, 0.015] }\n", rate=rate)
                load, _ = mean(ticks, "env_force_z_N", 2, 2.8)
                friction, _ = mean(ticks, "env_force_x_N", 2, 2.8)
                self.tell(f"slides at {rate} Hz", -friction / load, 0.5)
                self.assertGreater(load, 1.5)  # N
                self.assertAlmostEqual(-friction, 0.5 * load, delta=self.error_of_friction * load)
                self.assertLess(largest_jump(ticks, 2, 2.8), self.largest_jump)

    def test_a_brick_is_pushed_at_its_friction(self):
        due = self.friction_of_brick * 0.3 * GRAVITY  # N
        for rate in self.rates:
            with self.subTest(rate=rate):
                ticks, track = on_time(self.play, "brick", 5, reach(0.5, 0, 0.021) + reach(4, 0.15, 0.021), rate=rate)
                force, deviation = mean(ticks, "env_force_x_N", 2, 4.2)
                self.tell(f"pushes at {rate} Hz, N, deviation {deviation:.4f} N", -force, due)
                self.assertAlmostEqual(-force, due, delta=self.error_of_brick * due)
                self.assertLess(deviation, self.largest_deviation_of_brick)
                self.assertLess(largest_jump(ticks, 2, 4.2), self.largest_jump_of_bodies)
                self.assertAlmostEqual(track[-1][0], 0.19, delta=0.01)    # m: tool's and brick's halves farther

    def gains_the_momentum_that_the_hand_felt(self, scene, height):
        """The body of that scene, 0.3 kg, met by a tool at that height, m."""
        for rate in self.rates:
            with self.subTest(rate=rate):
                ticks, track = on_time(self.play, scene, 3, reach(0.5, 0, height) + reach(0.8, 0.08, height), rate=rate)
                gained = 0.3 * (track[-1][0] - track[-2][0]) / PRINTED  # N·s
                felt = -sum(float(row["env_force_x_N"]) for row in ticks) / SERVO_RATE
                self.tell(f"momentum at {rate} Hz, N s", gained, felt)
                self.assertGreater(felt, 0.02)
                self.assertAlmostEqual(gained, felt, delta=self.error_of_momentum * felt)

    def test_a_free_body_gains_the_momentum_that_the_hand_felt(self):
        self.gains_the_momentum_that_the_hand_felt("puck", 0.021)

    def test_a_body_that_is_lifted_weighs_what_it_weighs(self):
        weight = 0.3 * GRAVITY  # N
        for rate in self.rates:
            with self.subTest(rate=rate):
                ticks, track = on_time(self.play, "tray", 4, reach(2, 0, 0.085), rate=rate)
                force, deviation = mean(ticks, "env_force_z_N", 2.7, 3.3)
                self.tell(f"weighs at {rate} Hz, N, deviation {deviation:.4f} N", -force, weight)
                self.assertAlmostEqual(-force, weight, delta=self.error_of_weight * weight)
                self.assertLess(deviation, self.largest_deviation_of_load)
                self.assertLess(largest_jump(ticks, 1, 3.3), self.largest_jump_of_bodies)  # after the tool met it
                self.assertGreater(track[-1][2], 0.095)     # m: 15 mm above the rails

    def bears_a_body_while_its_world_stalls(self, stall):
        weight = 0.3 * GRAVITY  # N
        ticks, track = self.play("tray", 5, reach(2, 0, 0.085), stall=stall)
        least, most = extremes(ticks, "env_force_z_N", 1.2, 4)
        self.assertGreater(-most, weight - self.largest_error_after_stall)
        self.assertLess(-least, weight + self.largest_error_after_stall)
        self.assertGreater(track[-1][2], 0.095)     # m: 15 mm above the rails

    def test_a_body_that_is_lifted_stays_on_the_tool_while_its_world_stalls(self):
        for stall in self.stalls:
            with self.subTest(stall=stall):
                in_some_attempt(self.bears_a_body_while_its_world_stalls, stall)

    def test_a_peg_in_a_hole_with_a_tenth_of_a_millimetre_on_each_side_rests_on_its_walls(self):
        ticks, _ = self.play("hole", 4.4, reach(0.8, 0, 0.06) + reach(0.8, 0, 0.035) + push(1, 2, 0) + push(1.5, -2, 0),
                             "--max-stiffness-sum", "8")
        self.rests(ticks, "env_force_x_N", -2, 1.8, 2.3)
        self.rests(ticks, "env_force_x_N", 2, 3, 3.7)
        depth = 2 / (4 * STIFFNESS)
        self.assertAlmostEqual(-mean(ticks, "proxy_x_m", 3, 3.7)[0], 0.0001 + depth, delta=0.05 * depth)  # m
