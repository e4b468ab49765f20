/* A hand in a MuJoCo world: the body "tool" is felt, other free bodies can be pushed.
 *
 *   haptic_server --device-option freedom=spatial --hand HAND.toml      # in another terminal
 *   touch scene.xml 127.0.0.1:47800 10                                 # 10 s
 */
#include <haptic.h>
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define EPSILON 0.005 /* m: the margin of the tool's geoms in the scene */
#define RATE 60       /* frames a second */

static mjModel* model;
static mjData* data;
static int tool; /* body */

static int is_free(int body) {
  return model->body_jntnum[body] == 1 && model->jnt_type[model->body_jntadr[body]] == mjJNT_FREE;
}

/* What the hand holds, as MuJoCo has it. */
static haptic_link tool_link(void) {
  const double no_size[3] = {0, 0, 0};
  haptic_link link = haptic_box(model->body_mass[tool], no_size);
  double R[9], turned[9];
  int i, j;
  memcpy(link.centre, model->body_ipos + 3 * tool, sizeof link.centre);
  mju_quat2Mat(R, model->body_iquat + 4 * tool);
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 3; ++j) turned[3 * i + j] = R[3 * i + j] * model->body_inertia[3 * tool + j];
  }
  mju_mulMatMatT(link.inertia, turned, R, 3, 3, 3);
  return link;
}

/* The tool goes where the proxy is. MuJoCo's angular velocity has the body's axes. */
static void drive(const double* q, const double* v) {
  const int joint = model->body_jntadr[tool];
  double* at = data->qpos + model->jnt_qposadr[joint];
  double* speed = data->qvel + model->jnt_dofadr[joint];
  double back[4];
  mju_copy(at, q, 7);
  mju_copy3(speed, v);
  mju_negQuat(back, q + 3);
  mju_rotVecQuat(speed + 3, v + 3, back);
}

/* The world as it is at the start of a step, which is what MuJoCo's contacts are of. */
static void describe_body(int body, haptic_body* to) {
  const double* inertia = model->body_inertia + 3 * body;
  double R[9], turned[9], W[9], V[6];
  int i;
  memset(to, 0, sizeof *to);
  to->id = (uint32_t)body;
  memcpy(to->centre, data->xipos + 3 * body, sizeof to->centre);
  mj_objectVelocity(model, data, mjOBJ_BODY, body, V, 0); /* angular first; about the centre */
  memcpy(to->velocity, V + 3, 3 * sizeof(double));
  memcpy(to->velocity + 3, V, 3 * sizeof(double));
  memcpy(R, data->ximat + 9 * body, sizeof R);
  for (i = 0; i < 9; ++i) turned[i] = R[i] / inertia[i % 3];
  mju_mulMatMatT(W, turned, R, 3, 3, 3);
  for (i = 0; i < 3; ++i) {
    to->inverse_inertia[7 * i] = 1 / model->body_mass[body];
    memcpy(to->inverse_inertia + 6 * (3 + i) + 3, W + 3 * i, 3 * sizeof(double));
    to->acceleration[i] = model->opt.gravity[i];
  }
}

/* The bodies of the contacts, those first that the tool touches: the server moves eight. */
static size_t find_bodies(const haptic_contact* contacts, size_t contact_count,
                          haptic_body* bodies) {
  size_t count = 0, i, j;
  int of_tool, side;
  for (of_tool = 1; of_tool >= 0; --of_tool) {
    for (i = 0; i < contact_count; ++i) {
      const haptic_contact* contact = contacts + i;
      if ((contact->a_kind == HAPTIC_TOOL_LINK) != of_tool) continue;
      for (side = 0; side < 2; ++side) {
        const uint8_t kind = side ? contact->a_kind : contact->b_kind;
        const uint32_t body = side ? contact->a_index : contact->b_index;
        for (j = 0; j < count && bodies[j].id != body; ++j) {
        }
        if (kind != HAPTIC_MOVABLE_BODY || j < count || count == HAPTIC_MAX_BODIES) continue;
        describe_body((int)body, bodies + count++);
      }
    }
  }
  return count;
}

static void set_side(int body, uint8_t* kind, uint32_t* index) {
  *kind = body == tool ? HAPTIC_TOOL_LINK : is_free(body) ? HAPTIC_MOVABLE_BODY : HAPTIC_WORLD;
  *index = body == tool ? 0 : (uint32_t)body;
}

/* Side a is the tool, else a free body. MuJoCo's point lies halfway, its normal leads to geom2. */
static size_t find_contacts(haptic_contact* contacts) {
  size_t count = 0;
  int i, k;
  for (i = 0; i < data->ncon && count < HAPTIC_MAX_CONTACTS; ++i) {
    const mjContact* from = data->contact + i;
    haptic_contact* to = contacts + count;
    const int body1 = model->geom_bodyid[from->geom1], body2 = model->geom_bodyid[from->geom2];
    const int first_is_a = body1 == tool || (body2 != tool && is_free(body1));
    const int a = first_is_a ? body1 : body2, b = first_is_a ? body2 : body1;
    double force[6];
    memset(to, 0, sizeof *to);
    set_side(a, &to->a_kind, &to->a_index);
    set_side(b, &to->b_kind, &to->b_index);
    if (to->a_kind == HAPTIC_WORLD) continue;
    to->pair = (uint32_t)(from->geom1 * model->ngeom + from->geom2);
    for (k = 0; k < 3; ++k) {
      to->normal[k] = first_is_a ? -from->frame[k] : from->frame[k];
      to->point[k] = from->pos[k] - 0.5 * from->dist * to->normal[k];
    }
    to->separation = from->dist;
    to->friction = from->friction[0];
    if (a != tool && from->efc_address >= 0) {
      mj_contactForce(model, data, i, force);
      to->load = force[0] > 0 ? force[0] : 0;
    }
    ++count;
  }
  return count;
}

/* The tool's impulses act during the whole frame of `period` seconds. */
static void push(haptic_session* touch, double period) {
  haptic_impulse impulses[HAPTIC_MAX_BODIES];
  const size_t count = haptic_take_impulses(touch, period, impulses);
  size_t i;
  int k;
  mju_zero(data->xfrc_applied, 6 * model->nbody);
  for (i = 0; i < count; ++i) {
    for (k = 0; k < 6; ++k) {
      data->xfrc_applied[6 * impulses[i].body + (unsigned)k] = impulses[i].impulse[k] / period;
    }
  }
}

static void sleep_until(struct timespec* time, double later) {
  time->tv_nsec += (long)(1e9 * later);
  time->tv_sec += time->tv_nsec / 1000000000;
  time->tv_nsec %= 1000000000;
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, time, NULL);
}

static int simulate(haptic_session* touch, const haptic_options* options, double seconds) {
  static haptic_contact contacts[HAPTIC_MAX_CONTACTS];
  static haptic_body bodies[HAPTIC_MAX_BODIES];
  haptic_state state = {0};
  double q[7], v[6] = {0};
  struct timespec time;
  const int frames = (int)(seconds * RATE);
  int frame, i, steps, brick = mj_name2id(model, mjOBJ_BODY, "brick");
  mju_copy(q, options->q, 7);
  clock_gettime(CLOCK_MONOTONIC, &time);
  for (frame = 1; frame <= frames; ++frame) {
    size_t contact_count, body_count;
    haptic_poll(touch, &state);
    if (state.fresh) {
      mju_copy(q, state.q, 7);
      mju_copy(v, state.v, 6);
    }
    /* As many as bring MuJoCo's time up to the hand's, also after a frame that came late. */
    steps = haptic_take_steps(touch, model->opt.timestep);
    if (steps > 0) push(touch, steps * model->opt.timestep);
    for (i = 0; i < steps; ++i) {
      drive(q, v);
      mj_step(model, data);
    }
    drive(q, v);
    mj_forward(model, data); /* contacts and loads of this very moment */
    if (steps > 0 && haptic_sample(touch, q, v, steps * model->opt.timestep) != 0) break;
    contact_count = find_contacts(contacts);
    body_count = find_bodies(contacts, contact_count, bodies);
    haptic_track(touch, contacts, contact_count, bodies, body_count);
    if (steps > 0 && haptic_send(touch, contacts, contact_count, bodies, body_count) < 0) break;
    if (frame % (RATE / 2) == 0) {
      printf("%s tool %.4f %.4f %.4f force %.3f %.3f %.3f brick %.4f contacts %d\n",
             state.connected    ? "connected"
             : state.message[0] ? state.message
                                : "no server",
             q[0], q[1], q[2], state.command[0], state.command[1], state.command[2],
             brick < 0 ? 0 : data->xpos[3 * brick], (int)contact_count);
    }
    sleep_until(&time, 1.0 / RATE);
  }
  if (frame <= frames) fprintf(stderr, "touch: %s\n", haptic_error(touch));
  return frame > frames ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(int argc, char** argv) {
  char error[1000] = "";
  haptic_options options = haptic_default_options();
  haptic_session* touch;
  haptic_link link;
  int status;
  model = mj_loadXML(argc > 1 ? argv[1] : "scene.xml", NULL, error, sizeof error);
  if (model == NULL) {
    fprintf(stderr, "touch: %s\n", error);
    return EXIT_FAILURE;
  }
  data = mj_makeData(model);
  tool = mj_name2id(model, mjOBJ_BODY, "tool");
  if (tool < 0 || !is_free(tool)) {
    fprintf(stderr, "touch: the scene must have a body \"tool\" with a free joint\n");
    return EXIT_FAILURE;
  }
  mj_forward(model, data);
  link = tool_link();
  options.links = &link;
  if (argc > 2) options.server = argv[2];
  mju_copy(options.q, data->qpos + model->jnt_qposadr[model->body_jntadr[tool]], 7);
  options.rate = RATE;
  options.epsilon = EPSILON;
  touch = haptic_open(&options, error, sizeof error);
  if (touch == NULL) {
    fprintf(stderr, "touch: %s\n", error);
    return EXIT_FAILURE;
  }
  status = simulate(touch, &options, argc > 3 ? atof(argv[3]) : 10);
  haptic_close(touch);
  mj_deleteData(data);
  mj_deleteModel(model);
  return status;
}
