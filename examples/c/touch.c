/* A cube of 0.1 m in the hand, above a floor: 10 s, with a haptic_server of its own where none
 * runs. cc touch.c -o touch $(pkg-config --cflags --libs haptic) && ./touch */
#include <haptic.h>
#include <stdio.h>
#include <time.h>

int main(void) {
  static const struct timespec frame = {0, 16666667}; /* 60 Hz */
  static const haptic_shape shapes[2] = {
      {HAPTIC_BOX, HAPTIC_TOOL_LINK, 0, 1, 1, 0, {0.1, 0.1, 0.1}, NULL, NULL, 0},
      {HAPTIC_HALF_SPACE, HAPTIC_WORLD, 0, 1, 1, 0, {0}, NULL, NULL, 0}};
  static const haptic_pose poses[2] = {{{0, 0, 0}, {1, 0, 0, 0}}, {{0, 0, -0.06}, {1, 0, 0, 0}}};
  static const double target[3] = {0, 0, -0.03},
                      upright[4] = {1, 0, 0, 0}; /* 20 mm into the floor */
  char error[HAPTIC_MAX_TEXT] = "";
  haptic_options options = haptic_default_options();
  haptic_session* touch = haptic_open(&options, error, sizeof error);
  haptic_state state = {0};
  const char* page;
  if (touch == NULL || haptic_offer(touch, shapes, poses, NULL, 2, NULL, 0, NULL, 0) != 0) {
    fprintf(stderr, "touch: %s\n", touch == NULL ? error : haptic_error(touch));
    return 1;
  }
  page = haptic_show(touch, 0, 1);
  printf("%s\npage: %s\n", haptic_own_server(touch), page != NULL ? page : haptic_error(touch));
  haptic_hold(touch, target, upright); /* the simulated device's hand: 200 N/m */
  for (int i = 1; i <= 600; ++i) {
    haptic_poll(touch, &state);
    haptic_sample(touch, state.q_count > 0 ? state.q : options.q, state.v, 1.0 / 60);
    haptic_send(touch, NULL, 0, NULL, 0);
    if (i % 60 == 0) printf("%.2f N %s\n", state.contact_wrench[2], state.message);
    nanosleep(&frame, NULL);
  }
  haptic_close(touch);
  return 0;
}
