/* A server in virtual time, in the process of its client: bit for bit the same each time, at any
 * load, as fast as the machine can. What works with it works with haptic_server: it is the same
 * tick, and the sessions are those of haptic.h, with another library, libhaptic_virtual.so.
 *
 *   const char* arguments[] = {"--hand", "hand.toml", "--stiffness", "16000"};
 *   haptic_network network = {0.02, 0, 0.01, 1};      // 20 ms each way, 1 % is lost
 *   haptic_virtual* server = haptic_virtual_open(arguments, 4, &network, error, sizeof error);
 *   options.server = haptic_virtual_address(server);
 *   haptic_session* touch = haptic_open(&options, error, sizeof error);
 *
 * Each haptic_poll() begins a frame, one nominal period after the previous one;
 * haptic_virtual_wait() makes it later. One thread at a time may use a server and its session.
 * With a server that is NULL nothing happens, and what is returned is -1, 0 or "".
 */
#ifndef HAPTIC_VIRTUAL_H
#define HAPTIC_VIRTUAL_H

#include "haptic.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct haptic_virtual haptic_virtual;

/* What the network does to each datagram, in either direction. */
typedef struct haptic_network {
  double delay;  /* it is under way at least this long, s */
  double jitter; /* and up to this much longer, uniformly drawn, s */
  double loss;   /* probability that it never arrives */
  uint64_t seed; /* of what is drawn, as the server begins */
} haptic_network;

/* arguments: haptic_server's, of contacts, controller, safety and a simulated device. network:
 * NULL: nothing is late or lost. Returns NULL if they cannot be used; `error` then says why. */
HAPTIC_API haptic_virtual* haptic_virtual_open(const char* const* arguments, size_t count,
                                               const haptic_network* network, char* error,
                                               size_t error_size);
/* For haptic_options, "virtual:N"; one session at a time. */
HAPTIC_API const char* haptic_virtual_address(const haptic_virtual* server);
/* What haptic_server would warn of as it starts, and a recording that could not go on, in lines; ""
 * if nothing. Until the next call. */
HAPTIC_API const char* haptic_virtual_warnings(const haptic_virtual* server);
/* s, from 0. */
HAPTIC_API double haptic_virtual_now(const haptic_virtual* server);
/* The server ends: zero force, goodbye to its client. Time goes on without it. */
HAPTIC_API void haptic_virtual_stop(haptic_virtual* server);
/* So many seconds pass, 0 to 1e6; otherwise -1, and nothing happens. */
HAPTIC_API int haptic_virtual_wait(haptic_virtual* server, double seconds);
/* From here on a frame begins so many seconds after the one before, 0 to 1e6 (0: as soon as there
 * is another poll: haptic_virtual_wait() is all that lets time pass); negative: the session's own
 * period again. */
HAPTIC_API void haptic_virtual_set_frame(haptic_virtual* server, double seconds);
/* From here on, without the seed. Returns -1 and changes nothing if a number cannot be used. */
HAPTIC_API int haptic_virtual_set_network(haptic_virtual* server, const haptic_network* network);
/* The names of what is known of each tick, as in haptic_server's --log: NAME or, where a number
 * stands for a word, NAME=WORD|WORD...; separated by commas. */
HAPTIC_API const char* haptic_virtual_columns(void);
/* Ticks so far. The latest 120,000 are kept. */
HAPTIC_API size_t haptic_virtual_ticks(const haptic_virtual* server);
/* Copies `count` ticks, from the one of number `begin` on, one after another, as many numbers as
 * there are columns each. Returns how many there were. */
HAPTIC_API size_t haptic_virtual_copy_ticks(const haptic_virtual* server, size_t begin,
                                            size_t count, double* numbers);
/* A session that is open keeps it alive. */
HAPTIC_API void haptic_virtual_close(haptic_virtual* server);

#ifdef __cplusplus
}
#endif

#endif
