/* Touch a simulated world with a haptic device: the client library as a C interface.
 *
 *   haptic_options options = haptic_default_options();
 *   haptic_session* touch = haptic_open(&options, error, sizeof error);
 *   while (running) {
 *     haptic_poll(touch, &state);                       // move the tool towards state.q
 *     step(period);                                     // your engine
 *     haptic_sample(touch, q, v, period);               // where the tool is now
 *     haptic_send(touch, contacts, contact_count, NULL, 0);
 *   }
 *   haptic_close(touch);
 *
 * SI units, world axes, right-handed. Quaternions are (w, x, y, z). No call waits for the network
 * or throws. A session belongs to the process that opened it, and to one thread at a time.
 * PROTOCOL.md says in full what each field means.
 *
 * A call fails and does nothing if the session or what it is to read is NULL, if another thread is
 * in a call of the same session, or in a process that was forked from the session's:
 * haptic_error() says so. haptic_close() waits for the other thread.
 */
#ifndef HAPTIC_H
#define HAPTIC_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define HAPTIC_API __attribute__((visibility("default")))
#else
#define HAPTIC_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Incremented whenever a struct or function below changes; haptic_abi() returns the library's. */
#define HAPTIC_ABI 5

#define HAPTIC_MAX_DOF 16
#define HAPTIC_MAX_CONFIGURATION 17
#define HAPTIC_MAX_CONTACTS 192
#define HAPTIC_MAX_BODIES 16
#define HAPTIC_MAX_POSES 64
#define HAPTIC_MAX_TEXT 240
#define HAPTIC_CURVE_TERMS 10
#define HAPTIC_NO_BODY 0xffffffffu

enum haptic_joint {
  HAPTIC_FIXED = 0,
  HAPTIC_REVOLUTE = 1,  /* q: angle, rad */
  HAPTIC_PRISMATIC = 2, /* q: distance, m */
  HAPTIC_PLANAR = 3,    /* q: x, y (m), angle (rad), in the plane z = 0 of the joint's frame */
  HAPTIC_FREE = 4,     /* q: position (m) and quaternion of the link; v: linear, angular velocity */
  HAPTIC_GUIDED = 5,   /* along its haptic_curve; q: from `lower` to `upper`, rad or m */
  HAPTIC_FOLLOWING = 6 /* along its haptic_curve, by the q of a guided link before it */
};

typedef struct haptic_session haptic_session;

/* A link of the virtual tool. The first one is the root; parents come before children. */
typedef struct haptic_link {
  int32_t parent;      /* index of a link before it; -1: the world */
  int32_t joint;       /* enum haptic_joint; FREE and PLANAR for the root only */
  double position[3];  /* joint's frame in the parent's link frame, m */
  double rotation[4];  /* unit */
  double axis[3];      /* of REVOLUTE and PRISMATIC, unit, in the joint's frame */
  double mass;         /* kg, >= 0 */
  double centre[3];    /* centre of mass in the link's frame, m */
  double inertia[9];   /* about the centre of mass, link's axes, kg m^2 */
  double lower, upper; /* limits of q of REVOLUTE, PRISMATIC and GUIDED; +-1e9: none */
} haptic_link;

/* How a GUIDED or FOLLOWING link moves in its joint's frame: as a part of a mechanism that one
 * coordinate moves, such as a gripper's finger. Polynomials of x = (2 q - lower - upper) / (upper -
 * lower), which goes from -1 to 1 between the limits of the coordinate. */
typedef struct haptic_curve {
  int32_t link;
  int32_t leader;  /* whose q: a GUIDED link, itself or one before it */
  double armature; /* what a motor adds to the inertia of the coordinate, kg or kg m^2 */
  double terms[HAPTIC_CURVE_TERMS][7]; /* factors of 1, x, x^2, ...: position of the link, m, and
                                          its quaternion w, x, y, z, of any length but 0 */
} haptic_curve;

/* A servo on the coordinate q of a joint that has one: a spring and damper to `target`, of limited
 * force. In m and N, or rad and N m, as q is. */
typedef struct haptic_drive {
  int32_t link;           /* whose joint: REVOLUTE, PRISMATIC or GUIDED */
  int32_t follows_device; /* 1: the device's gripper leads it, from `closed` to `open`, if there is
                             one; 0: it goes to `target` */
  double target, closed, open;
  double stiffness, damping; /* >= 0 */
  double most;               /* largest force, >= 0 */
} haptic_drive;

typedef struct haptic_options {
  const char* server;   /* "HOST:PORT"; NULL: the usual one, or one of this session's own where
                           nobody listens there, see haptic_own_server() */
  const char* key_file; /* shared with the server; NULL: unsealed, for this machine alone */
  const haptic_link* links;
  size_t link_count;                  /* 1 to 16 */
  int32_t hand_link;                  /* which one the user holds */
  double hand_position[3];            /* hand's frame in that link's frame, m */
  double hand_rotation[4];            /* unit */
  double gravity[3];                  /* on the tool, m/s^2 */
  double length;                      /* size of the tool, m, > 0 */
  double q[HAPTIC_MAX_CONFIGURATION]; /* where the tool is now */
  double rate;                        /* of the simulator's steps, Hz */
  double epsilon;                     /* contacts are sent up to this separation, m, 0 to 1 */
  int32_t clears_fault;               /* 1: a person asks for this session: ends a released fault */
  uint32_t made_of_defaults;          /* leave it as haptic_default_options() has it */
  const haptic_curve* curves;         /* one of each GUIDED or FOLLOWING link */
  size_t curve_count;
} haptic_options;

enum haptic_side { HAPTIC_WORLD = 0, HAPTIC_TOOL_LINK = 1, HAPTIC_MOVABLE_BODY = 2 };

/* A contact that touches (separation <= 0) or is near. The normal points from side b to side a,
 * which is the tool if that takes part. */
typedef struct haptic_contact {
  uint64_t identity; /* the same from frame to frame, unique in one; see haptic_track() */
  uint32_t pair;     /* which two convex pieces; 0 if the engine does not say */
  uint16_t axis;     /* 0 */
  uint8_t a_kind;    /* enum haptic_side */
  uint8_t b_kind;
  uint32_t a_index; /* of the link; of a body, your own number for it */
  uint32_t b_index;
  double point[3];    /* on the surface of b, m */
  double normal[3];   /* unit, from b to a */
  double separation;  /* true distance, m; negative: they overlap */
  double velocity[3]; /* of b's point, m/s */
  double friction;    /* coefficient of the two materials, above 10 as 10; negative: the server's
                         own */
  double load;        /* normal force of a contact without the tool, N */
  uint32_t plane; /* 1: a flat face of side a lies on a corner or an edge of side b, and the normal
                     turns with a; 0: the normal turns with b */
} haptic_contact;

/* A body that the tool can push. List those first that the tool touches: haptic_server moves the
 * first eight; to it the others are constraints that move with the velocity of their contacts. */
typedef struct haptic_body {
  uint32_t id;
  uint32_t round;             /* 1: a surface of revolution about `axis`, 2: a sphere; 0 otherwise.
                                 The contacts of a round body do not rotate with it: unmarked, a
                                 rolling body pushes back as if it had facets */
  double centre[3];           /* of mass, m */
  double velocity[6];         /* linear (m/s), angular (rad/s) */
  double inverse_inertia[36]; /* 6x6 about the centre of mass: linear, then angular; what joints
                                 leave */
  double acceleration[6];     /* by all forces except contacts */
  double axis[3];             /* with round 1: unit, through the centre of mass */
} haptic_body;

/* Each is centred in its own frame, and 1e-6 to 2e6 m large. */
enum haptic_shape_kind {
  HAPTIC_SPHERE = 0,     /* size[0]: radius, m */
  HAPTIC_CAPSULE = 1,    /* along z: radius, length of the cylindrical part */
  HAPTIC_CYLINDER = 2,   /* along z: radius, length */
  HAPTIC_BOX = 3,        /* edge lengths */
  HAPTIC_ELLIPSOID = 4,  /* semi-axes */
  HAPTIC_HULL = 5,       /* the convex hull of `vertices` */
  HAPTIC_HALF_SPACE = 6, /* z <= 0; of the world only */
  HAPTIC_MESH = 7        /* `triangles` of `vertices`, counter-clockwise seen from outside; of the
                            tool only if it is convex */
};

typedef struct haptic_shape {
  int32_t kind;         /* enum haptic_shape_kind */
  int32_t side;         /* enum haptic_side: whose it is */
  uint32_t index;       /* of the link, or your own number for the body */
  uint32_t group, mask; /* two shapes may touch if a bit of one's group is in the other's mask */
  uint32_t vertex_count;
  double size[3];            /* m, > 0 */
  const double* vertices;    /* of HULL and MESH: x, y, z each, m; not kept */
  const uint32_t* triangles; /* of MESH: three vertices each; not kept */
  size_t triangle_count;
} haptic_shape;

/* How two coefficients of friction combine in a contact; if the two rules differ, the later one in
 * this list counts. */
enum haptic_friction_rule {
  HAPTIC_AVERAGE = 0, /* as Rapier, PhysX */
  HAPTIC_MINIMUM = 1,
  HAPTIC_PRODUCT = 2, /* as Bullet */
  HAPTIC_MAXIMUM = 3  /* as MuJoCo */
};

typedef struct haptic_material {
  double friction;  /* coefficient, above 10 as 10; negative: the other material's, and if that is
                       negative, too, the server's own */
  int32_t rule;     /* enum haptic_friction_rule */
  int32_t priority; /* 0 to 255: the friction of the higher one counts alone */
} haptic_material;

typedef struct haptic_pose {
  double position[3]; /* of a shape's or body's frame in the world, or as a function says, m */
  double rotation[4]; /* unit quaternion w, x, y, z */
} haptic_pose;

/* Where a body is whose shapes were offered: its frame, and that frame's velocity. */
typedef struct haptic_body_pose {
  uint32_t body;
  uint32_t kept; /* 1: nobody else may move it, as when it was reset: the hand lets go of it */
  haptic_pose pose;
  double velocity[6]; /* of the frame's origin, linear (m/s), angular (rad/s), world axes */
} haptic_body_pose;

/* What the server must know of a body to move it while the hand holds it: its inertia, and the
 * joint that it hangs on, if any. Of several joints on one body it can be told none. */
typedef struct haptic_dynamics {
  uint32_t body;
  int32_t joint;          /* enum haptic_joint: FREE, or REVOLUTE or PRISMATIC with what follows
                             below `angular_damping` */
  double mass;            /* kg, 1e-6 to 1e6 */
  double centre[3];       /* of mass, in the body's frame, m */
  double inertia[9];      /* about the centre of mass, body's axes, kg m^2 */
  double gravity[3];      /* what its weight accelerates it by, world, m/s^2 */
  double damping;         /* of its velocity, 1/s, */
  double angular_damping; /* and of its angular velocity; of a free body without others on it */
  uint32_t parent; /* the body that it hangs on, also one of these; HAPTIC_NO_BODY: the world */
  uint32_t reserved;
  haptic_pose in_parent; /* the joint's frame in the parent's, or in the world, */
  haptic_pose in_body;   /* and in the body's; q is 0 where both lie on each other */
  double axis[3];        /* of growing q, unit, in the joint's frame */
  double lower, upper;   /* limits of q, rad or m; +-1e9: none */
  double stiffness;      /* of a spring, N/m or N m/rad, */
  double reference;      /* which is at rest at this q */
  double joint_damping;  /* N s/m or N m s/rad */
  double friction;       /* largest dry friction, N or N m */
  double armature;       /* inertia of a motor in it, kg or kg m^2 */
} haptic_dynamics;

/* Where the server has a body. */
typedef struct haptic_held_body {
  uint32_t body;
  uint32_t let_go; /* 1: for the last time; from here on the body is yours */
  haptic_pose pose;
  double velocity[6]; /* of the frame's origin, as in haptic_body_pose */
  double q, v;        /* of its joint, if it hangs on one */
} haptic_held_body;

/* What the tool did to a body: apply impulse / period as a wrench at its centre during the step. */
typedef struct haptic_impulse {
  uint32_t body;
  uint32_t reserved;
  double impulse[6]; /* N s, N m s */
} haptic_impulse;

enum haptic_server {
  HAPTIC_SERVER_OFF = 0,
  HAPTIC_SERVER_ACTIVE = 1, /* force is on */
  HAPTIC_SERVER_FADING = 2,
  HAPTIC_SERVER_FAULT = 3,  /* until a person asks for a session */
  HAPTIC_SERVER_ARMING = 4, /* waits for the first update */
  HAPTIC_SERVER_RAMPING = 5 /* force rises */
};

/* The latest news of the server. Booleans are 0 or 1. */
typedef struct haptic_state {
  int32_t connected;
  int32_t began;         /* a session began in this poll: the proxy is at options.q */
  int32_t lost;          /* it ended in this poll */
  int32_t fresh;         /* what follows came in this poll */
  uint64_t step;         /* of the server's loop */
  uint64_t acknowledged; /* the latest update that the server has taken */
  int32_t q_count, v_count;
  double q[HAPTIC_MAX_CONFIGURATION]; /* of the proxy: move the tool there */
  double v[HAPTIC_MAX_DOF];
  double contact_wrench[6]; /* of the contacts on the hand, N and N m */
  double command[6];        /* what the device was given, after limits */
  double device_position[3];
  double device_rotation[4];
  int32_t server;                /* enum haptic_server */
  int32_t active, predicted;     /* local contacts */
  uint32_t buttons;              /* bit i: button i is down */
  int32_t scene;                 /* 1: the server finds the contacts of the shapes offered to it */
  int32_t holds;                 /* 1: it moves what the hand holds, see haptic_take_held() */
  double gripper;                /* of the device: 0 closed to 1 open */
  double grip;                   /* what opens the driven joints: force of contacts, N or N m */
  double round_trip;             /* s */
  double servo_rate;             /* Hz */
  char message[HAPTIC_MAX_TEXT]; /* for a person: nobody answers; why a session, update, contact
                                    or the offered shapes were refused; how a body moves otherwise
                                    than reported; or that the session's own server has ended. ""
                                    when a session begins */
} haptic_state;

HAPTIC_API int haptic_abi(void);
/* The usual server (server: NULL): the one that the environment variable HAPTIC_SERVER names, or
 * 127.0.0.1:47800, or, if nobody listens there, one that this session starts. A free rigid tool of
 * 1 kg and 0.1 m at the origin, 60 Hz, epsilon 5 mm. */
HAPTIC_API haptic_options haptic_default_options(void);
/* A solid box of that mass and those edge lengths as a link, free: a start for your own. */
HAPTIC_API haptic_link haptic_box(double mass, const double size[3]);

/* NULL if the options cannot be used, or were not begun with haptic_default_options(); `error` then
 * says why, in one line. A server that is named need not run yet: it is asked until it answers. */
HAPTIC_API haptic_session* haptic_open(const haptic_options* options, char* error,
                                       size_t error_size);
/* A sentence on the server that this session started, with a simulated device at a free port of
 * this machine, because its options named none and nobody listens at the usual address; "" if it
 * started none. haptic_hold() moves its hand. It ends when the session, the process (even by a
 * crash) or the thread that called haptic_open() ends, so that thread should last. It is a child of
 * the process, which should wait for other children by their ids. It is the program that
 * HAPTIC_SERVER_PROGRAM names, or haptic_server beside this library or in PATH, and it records to
 * the file that HAPTIC_RECORD names, if it does. */
HAPTIC_API const char* haptic_own_server(const haptic_session* session);
/* Starts a program that serves the page of this session to browsers on this machine, with the
 * offered shapes, contacts, forces and charts; the mouse is the hand of a simulated device. It ends
 * when the session, the process or the calling thread ends, so that thread should last. port: at
 * 127.0.0.1; 0: any free one. open: 1 shows it in a browser. Waits some tenths of a second until
 * the page is ready; a second call returns the same address. With a key the page asks for a token,
 * which is part of the address, and no browser is opened. Returns the address, valid until the next
 * call of this or haptic_close(), or NULL with haptic_error(). The program is what
 * HAPTIC_PAGE_PROGRAM names, or haptic_page beside this library or in PATH. */
HAPTIC_API const char* haptic_show(haptic_session* session, uint16_t port, int open);
/* Says goodbye, waits up to 2 s for a server of the session's own to end, and frees the session.
 * NULL is ignored. */
HAPTIC_API void haptic_close(haptic_session* session);

/* Gives the server the shapes of the world, the tool and the bodies. It then finds their contacts
 * itself at every step of the loop, however late an update comes, and haptic_send() need not
 * contain them. Best called before the first haptic_poll(). Sessions that follow a lost one get the
 * shapes, too. When shapes come, go or change, offer all of them again: the old ones stay until the
 * server has the new ones. Taking them needs up to some seconds: state.scene is 1 afterwards. A
 * server that takes no shapes, or cannot use these, says so in state.message; contacts can still be
 * sent.
 *
 * poses: of each shape in the frame of its link or body, of the world's in the world. materials: of
 * each shape, or NULL: friction is the server's own. excluded: twice `excluded_count` indices of
 * shapes that never touch, or NULL; shapes of one link or body never do. What is fixed to each
 * other is one surface, whose inner edges are not felt.
 *
 * dynamics: of bodies that the tool can push, or NULL. With them the server moves what the hand
 * holds, see haptic_take_held(). 0, or -1 with haptic_error(), which names shape or body. */
HAPTIC_API int haptic_offer(haptic_session* session, const haptic_shape* shapes,
                            const haptic_pose* poses, const haptic_material* materials,
                            size_t count, const uint32_t* excluded, size_t excluded_count,
                            const haptic_dynamics* dynamics, size_t dynamics_count);
/* Where the bodies of offered shapes are, for the next haptic_send(). If there are more than
 * HAPTIC_MAX_POSES, give those near the tool: a body without a pose does not exist. Bodies that the
 * tool can push also go to haptic_send(), those that were offered with dynamics only where
 * state.holds is 0, or where they touch, themselves or by others, one without; the others keep
 * their velocity. 0, or -1 with haptic_error(). */
HAPTIC_API int haptic_place(haptic_session* session, const haptic_body_pose* bodies, size_t count);

/* Once per step, before it. `state` is zero before the first call and the same one in each: what
 * did not come stays as it was. Where it fails the state is zero, and its message says why. */
HAPTIC_API void haptic_poll(haptic_session* session, haptic_state* state);
/* The time of the session's clock, s, of any steady origin: the machine's, or that of a server in
 * virtual time (haptic_virtual.h). 0 without a session. */
HAPTIC_API double haptic_now(const haptic_session* session);
/* The number of the present session, as recordings have it; 0 without one. */
HAPTIC_API uint64_t haptic_session_id(const haptic_session* session);
/* How many steps of `step` seconds a real-time engine must take in the frame that begins, after
 * haptic_poll(). This makes up for late frames. 0: take, sample and send nothing in this frame;
 * -1 with haptic_error() if `step` is not > 0. */
HAPTIC_API int haptic_take_steps(haptic_session* session, double step);
/* Before each step: the bodies that the hand holds, to be put there as the tool is, and moved by
 * nothing else during the step; and once more each that it has let go of. Returns how many, at most
 * HAPTIC_MAX_POSES, which `bodies` must hold. */
HAPTIC_API size_t haptic_take_held(haptic_session* session, haptic_held_body* bodies);
/* Whether your tool itself pushes what it touches in your engine during this frame, after
 * haptic_take_steps(), as what lies on it when a session begins: until the impulses cover whole
 * frames and, where state.holds and haptic_send() had no bodies, while the hand holds none. 1 or
 * 0. */
HAPTIC_API int haptic_tool_pushes(haptic_session* session);
/* The impulses for a step of `period` seconds, > 0, that begins. Returns how many, at most
 * HAPTIC_MAX_BODIES, which `impulses` must hold. */
HAPTIC_API size_t haptic_take_impulses(haptic_session* session, double period,
                                       haptic_impulse* impulses);
/* After the step: the tool's configuration and velocity, for which the contacts are found. 0, or
 * -1 with haptic_error() if a number is not finite or the quaternion of a free tool is not of
 * length 1. */
HAPTIC_API int haptic_sample(haptic_session* session, const double* q, const double* v,
                             double period);
/* Gives contacts lasting identities where the engine has none: by pair, place on side a and normal.
 * Call it between haptic_sample() and haptic_send(), with the same bodies as haptic_send(), which
 * refuses what is wrong. Contacts beyond HAPTIC_MAX_CONTACTS keep the identities they have. */
HAPTIC_API void haptic_track(haptic_session* session, haptic_contact* contacts, size_t count,
                             const haptic_body* bodies, size_t body_count);
/* What else than contacts and its weight pushes the tool: a weld, a tendon, a payload, drag, or
 * what a force sensor reads; after haptic_sample(), for the next haptic_send(). The server
 * finds how it depends on the tool's motion, so that the hand feels a load, a spring or a wall
 * between frames, too. wrench: N and N m about the origin of the link's frame. Several on one link
 * add up; without this there is none. 0, or -1 with haptic_error(). */
HAPTIC_API int haptic_external_wrench(haptic_session* session, int32_t link,
                                      const double wrench[6]);
/* The drives of the tool's joints, at most one of each, from the next haptic_send() until the next
 * call; none of them before the first. 0, or -1 with haptic_error(). */
HAPTIC_API int haptic_drive_joints(haptic_session* session, const haptic_drive* drives,
                                   size_t count);
/* Sends what is near. Returns the update's sequence, 0 without a session, -1 if something given is
 * wrong, or nothing was sampled yet: nothing is sent then, and haptic_error() names it. */
HAPTIC_API int64_t haptic_send(haptic_session* session, const haptic_contact* contacts,
                               size_t count, const haptic_body* bodies, size_t body_count);
/* Where the server's device is a simulated one, its hand draws the handle there, in the world: with
 * 200 N/m, 1 N m/rad and at most 10 N, from the next haptic_send() on and until haptic_release().
 * For a mouse, a script or a test in place of a device; a real one ignores it. 0, or -1 with
 * haptic_error() if a number cannot be used. */
HAPTIC_API int haptic_hold(haptic_session* session, const double position[3],
                           const double rotation[4]);
HAPTIC_API void haptic_release(haptic_session* session);
/* What was wrong with the latest call that failed, valid until the next call. For a NULL session
 * it says that the session must not be NULL. */
HAPTIC_API const char* haptic_error(const haptic_session* session);

#ifdef __cplusplus
}
#endif

#endif
