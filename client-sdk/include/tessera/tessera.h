/* libtessera-client: watch a Tessera session in your own app (C99 or newer, C++).
 *
 *   1. tesseraCreateSession() with the ticket of a session; it returns at once and connects in the
 * background.
 *   2. Every display frame: tesseraPollEvent() until there is none, tesseraSendPose(), tesseraAcquireFrame(),
 *      tesseraDraw() in your OpenGL ES 3 context, and, once it is on the display, tesseraReportDisplayed().
 *   3. tesseraDestroyRenderer(), tesseraDestroySession().
 *
 * Structs: set `type` to the value named beside the struct, and `next` to NULL or to a struct that may extend
 * this one. Zero in every other member is its default. Structs that are filled in need `type` and `next`,
 * too. Results: 0 done; above 0 done, with something to know; below 0 not done, and nothing has changed.
 * Space: metres, right-handed, +Y up; a head looks along its -Z. Angles are tangents. Colours are sRGB.
 * Time: int64 nanoseconds of CLOCK_MONOTONIC, as std::chrono::steady_clock on Linux and System.nanoTime() on
 * Android, within ±2^60 (36 years), where the wall clock's are not. Text: UTF-8. Threads: a function that
 * says "any thread" may be called from several at once. Those of the "drawing thread" may be called from one
 * thread at a time, all of a session's together. Destroying a handle must be the last use of it. Memory: the
 * library keeps no pointer that it is given, and no exception leaves it.
 */
#ifndef TESSERA_TESSERA_H_
#define TESSERA_TESSERA_H_

#include <stdint.h>

#if defined(__GNUC__)
#define TESSERA_API __attribute__((visibility("default")))
#else
#define TESSERA_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Of this header: 16 bits major, 16 bits minor. While the major version is 0, a library serves apps that were
 * built with a header of just its own version. */
#define TESSERA_MAKE_VERSION(major, minor) (((uint32_t)(major) << 16) | (uint32_t)(minor))
#define TESSERA_API_VERSION TESSERA_MAKE_VERSION(0, 1)

#define TESSERA_MAX_TEXT_SIZE 512 /* bytes, with the zero at the end */
#define TESSERA_MAX_VIEWS 2
#define TESSERA_BOUND_FRAMEBUFFER 0xffffffffu

typedef struct TesseraSession_T* TesseraSession;
typedef struct TesseraRenderer_T* TesseraRenderer;

typedef enum TesseraResult {
  TESSERA_SUCCESS = 0,
  TESSERA_EVENT_UNAVAILABLE = 1, /* nothing has happened since */
  TESSERA_FRAME_UNCHANGED = 2,   /* the frame is the one acquired before */
  TESSERA_FRAME_UNAVAILABLE = 3, /* no frame has come yet */
  TESSERA_NOT_STREAMING = 4,     /* still connecting: ignored */

  TESSERA_ERROR_INTERNAL = -1,            /* a defect of the library's or a driver's */
  TESSERA_ERROR_OUT_OF_MEMORY = -2,       /* of this machine or its GPU; or a limit of the server's */
  TESSERA_ERROR_VALIDATION = -3,          /* an argument; the text names it */
  TESSERA_ERROR_HANDLE_INVALID = -4,      /* NULL */
  TESSERA_ERROR_VERSION_UNSUPPORTED = -5, /* of header and library, or of library and server */
  TESSERA_ERROR_CALL_ORDER = -6,          /* the text says what must come first */
  TESSERA_ERROR_CONTEXT = -7,     /* no OpenGL ES context is current, or another than the renderer's */
  TESSERA_ERROR_UNREACHABLE = -8, /* the server, or no longer */
  TESSERA_ERROR_TIMEOUT = -9,
  TESSERA_ERROR_REFUSED = -10,       /* the server does not know the ticket's token */
  TESSERA_ERROR_SESSION_ENDED = -11, /* by the server; the text has its reason */
  TESSERA_ERROR_BUSY = -12,          /* another app watches the session: try again once it has left */

  TESSERA_RESULT_MAX_ENUM = 0x7fffffff
} TesseraResult;

typedef enum TesseraStructureType {
  TESSERA_TYPE_UNKNOWN = 0,
  TESSERA_TYPE_SESSION_CREATE_INFO = 1,
  TESSERA_TYPE_POSE_INFO = 2,
  TESSERA_TYPE_EVENT = 3,
  TESSERA_TYPE_FRAME_INFO = 4,
  TESSERA_TYPE_RENDERER_CREATE_INFO = 5,
  TESSERA_TYPE_DRAW_INFO = 6,
  TESSERA_TYPE_VIEW = 7,
  TESSERA_TYPE_LENS_DISTORTION = 8,
  TESSERA_TYPE_STATISTICS = 9,
  TESSERA_TYPE_STEREO_INFO = 10,
  TESSERA_TYPE_GAZE = 11,
  TESSERA_STRUCTURE_TYPE_MAX_ENUM = 0x7fffffff
} TesseraStructureType;

/* From the head or eye to the scene. The quaternion is (x, y, z, w), of length 1 (0.5 to 2 is brought there).
 */
typedef struct TesseraPose {
  double position[3]; /* within ±1e9 m */
  double orientation[4];
} TesseraPose;

/* Tangents of the four half angles: left < right, down < up, within ±60. Left and down are negative for a
 * view that contains its own axis. */
typedef struct TesseraFov {
  float left, right, down, up;
} TesseraFov;

/* TESSERA_TYPE_SESSION_CREATE_INFO; may be extended by TesseraStereoInfo */
typedef struct TesseraSessionCreateInfo {
  TesseraStructureType type;
  const void* next;
  uint32_t apiVersion;         /* TESSERA_API_VERSION */
  const char* ticket;          /* tessera://HOST:PORT/TOKEN[?ca=FILE]: who has it can watch the session */
  const char* applicationName; /* for the server's logs; up to 64 bytes; may be NULL */
  uint32_t viewWidth;          /* pixels of one eye, 1..16384: the server shades for these */
  uint32_t viewHeight;
  TesseraFov fov;         /* from where the head is; with TesseraStereoInfo it is not read */
  float displayRate;      /* Hz, 1..1000 */
  int64_t connectTimeout; /* ns, up to 60 s, for all addresses together, once the name is resolved; 0: 8 s */
} TesseraSessionCreateInfo;

/* Two eyes: the server sends what either of them sees, shaded once for both. In OpenXR, xrLocateViews() gives
 * these values in a reference space of the type VIEW. */
typedef struct TesseraStereoInfo { /* TESSERA_TYPE_STEREO_INFO */
  TesseraStructureType type;
  const void* next;
  TesseraPose eyes[TESSERA_MAX_VIEWS]; /* from the eye to the head; within ±1 m */
  TesseraFov fovs[TESSERA_MAX_VIEWS];
} TesseraStereoInfo;

/* TESSERA_TYPE_POSE_INFO; may be extended by TesseraGaze */
typedef struct TesseraPoseInfo {
  TesseraStructureType type;
  const void* next;
  TesseraPose pose;
  int64_t predictedDisplayTime; /* when the pose is expected to be true: later than in the call before */
} TesseraPoseInfo;

/* Where the eyes look, by an eye tracker: sessions with foveation shade less densely away from it. Poses
 * without a gaze mean straight ahead. Without TLS it travels in clear text. */
typedef struct TesseraGaze { /* TESSERA_TYPE_GAZE */
  TesseraStructureType type;
  const void* next;
  float direction[3]; /* in the head's axes, ahead is (0, 0, -1); of length 1 (0.5 to 2 is brought there) */
} TesseraGaze;

typedef enum TesseraEventKind {
  TESSERA_EVENT_STATE_CHANGED = 1,
  TESSERA_EVENT_FIRST_PICTURE = 2,   /* from now on tesseraDraw() shows the scene */
  TESSERA_EVENT_FRAME_AVAILABLE = 3, /* to acquire; a newer one may stand for several */
  TESSERA_EVENT_KIND_MAX_ENUM = 0x7fffffff
} TesseraEventKind;

typedef enum TesseraSessionState {
  TESSERA_SESSION_CONNECTING = 1,
  TESSERA_SESSION_STREAMING = 2,
  TESSERA_SESSION_LOST = 3, /* for good; the last frame can still be drawn */
  TESSERA_SESSION_STATE_MAX_ENUM = 0x7fffffff
} TesseraSessionState;

typedef struct TesseraEvent { /* TESSERA_TYPE_EVENT */
  TesseraStructureType type;
  void* next;
  TesseraEventKind kind;
  TesseraSessionState state;          /* after the event */
  TesseraResult result;               /* why it was lost; else TESSERA_SUCCESS */
  uint32_t frame;                     /* of the two kinds that have one */
  char reason[TESSERA_MAX_TEXT_SIZE]; /* why it was lost, and at which step; else empty */
} TesseraEvent;

typedef struct TesseraFrameInfo { /* TESSERA_TYPE_FRAME_INFO */
  TesseraStructureType type;
  void* next;
  uint32_t frame;      /* the server's number; wraps around */
  uint32_t atlasWidth; /* texels */
  uint32_t atlasHeight;
  uint64_t triangles; /* that it draws */
} TesseraFrameInfo;

typedef struct TesseraStatistics { /* TESSERA_TYPE_STATISTICS */
  TesseraStructureType type;
  void* next;
  uint64_t frames;           /* complete ones that could be acquired */
  uint64_t framesSkipped;    /* of these, replaced by a newer one before they were acquired */
  uint64_t packets;          /* of video */
  uint64_t packetsRecovered; /* lost, but sent again in time */
  uint64_t packetsLost;
  uint64_t framesOrphaned;  /* of video; they came whole, but build on one that did not */
  uint64_t decodeErrors;    /* damaged frames and geometry */
  int64_t networkRoundTrip; /* ns; 0: not measured yet */
} TesseraStatistics;

typedef struct TesseraRendererCreateInfo { /* TESSERA_TYPE_RENDERER_CREATE_INFO */
  TesseraStructureType type;
  const void* next;
  uint8_t background[3]; /* red, green, blue where the scene has nothing */
} TesseraRendererCreateInfo;

typedef struct TesseraViewport {
  int32_t x, y;           /* pixels; of the lower left corner, as in OpenGL */
  uint32_t width, height; /* 1..16384 */
} TesseraViewport;

typedef struct TesseraView { /* TESSERA_TYPE_VIEW; may be extended by TesseraLensDistortion */
  TesseraStructureType type;
  const void* next;
  TesseraPose pose; /* of the eye, for the moment at which the picture will be seen */
  TesseraFov fov;   /* what is drawn */
  TesseraViewport viewport;
  uint32_t framebuffer; /* its OpenGL name (0 is the default one), or TESSERA_BOUND_FRAMEBUFFER */
} TesseraView;

/* For the lens between display and eye: a pixel at tangents p on the screen shows what is seen at
 *   p (1 + k[0] r^2 + k[1] r^4 + k[2] r^6), r = |p|,
 * about the view's axis, for each colour by itself; black where that lies outside the view's fov. The scene
 * is drawn into a texture first, with 4 samples a pixel; without this struct that texture does not exist. */
typedef struct TesseraLensDistortion { /* TESSERA_TYPE_LENS_DISTORTION */
  TesseraStructureType type;
  const void* next;
  TesseraFov screen; /* the viewport's edges, were there no lens; all zero: as the view's fov */
  float red[3], green[3], blue[3];
} TesseraLensDistortion;

typedef struct TesseraDrawInfo { /* TESSERA_TYPE_DRAW_INFO */
  TesseraStructureType type;
  const void* next;
  uint32_t viewCount; /* 1..TESSERA_MAX_VIEWS */
  const TesseraView* views;
} TesseraDrawInfo;

/* Any thread. The library's own TESSERA_API_VERSION. */
TESSERA_API uint32_t tesseraGetVersion(void);
/* Any thread. The enumerator's name, e.g. "TESSERA_ERROR_TIMEOUT"; never NULL. The text lives forever. */
TESSERA_API const char* tesseraResultToString(TesseraResult result);
/* Any thread. What was wrong with the last call of this thread that failed, in words: what, where and what to
 * do. Empty before the first. Valid until the thread's next call. Has no part of a ticket's token. */
TESSERA_API const char* tesseraGetLastErrorText(void);
/* Any thread. Now, on the clock that all times here are of. */
TESSERA_API int64_t tesseraGetTime(void);

/* Any thread. Returns at once; events tell how it goes. A ticket serves one session at a time. */
TESSERA_API TesseraResult tesseraCreateSession(const TesseraSessionCreateInfo* info, TesseraSession* session);
/* Any thread. Tells the server; may wait for the network, up to connectTimeout (and a second) while it is
 * still connecting, or for the resolver of names. TESSERA_ERROR_CALL_ORDER: it has renderers. NULL is no
 * error. */
TESSERA_API TesseraResult tesseraDestroySession(TesseraSession session);

/* Any thread. The next event, in this order: connecting, streaming, first picture, frames, lost. */
TESSERA_API TesseraResult tesseraPollEvent(TesseraSession session, TesseraEvent* event);
/* Any thread. The newest pose of the head: once a display frame, or more often. The server renders for where
 * the head will be, by the times of these poses and of tesseraReportDisplayed(). */
TESSERA_API TesseraResult tesseraSendPose(TesseraSession session, const TesseraPoseInfo* info);
/* Any thread. All zero while connecting. */
TESSERA_API TesseraResult tesseraGetStatistics(TesseraSession session, TesseraStatistics* statistics);

/* Drawing thread. Takes the newest frame for the draws that follow. Also after the session was lost. */
TESSERA_API TesseraResult tesseraAcquireFrame(TesseraSession session, TesseraFrameInfo* info);
/* Drawing thread. The first picture of a frame was on the display at this time. Once a frame. */
TESSERA_API TesseraResult tesseraReportDisplayed(TesseraSession session, uint32_t frame, int64_t displayTime);

/* Drawing thread, with an OpenGL ES 3.0 (or newer) context current by EGL, which the renderer then belongs
 * to. */
TESSERA_API TesseraResult tesseraCreateRenderer(TesseraSession session, const TesseraRendererCreateInfo* info,
                                                TesseraRenderer* renderer);
/* Drawing thread, with its context current; else TESSERA_ERROR_CONTEXT, and nothing happens. NULL is no
 * error. */
TESSERA_API TesseraResult tesseraDestroyRenderer(TesseraRenderer renderer);
/* Drawing thread, with its context current. Fills the views' viewports with the frame acquired last; with
 * background while there is none (TESSERA_FRAME_UNAVAILABLE). Without a lens a framebuffer needs a depth
 * buffer, whose contents in the viewport are lost; it may be multisampled. Framebuffers that encode sRGB
 * themselves get the same picture. Bindings and state of the context are afterwards as they were. Transform
 * feedback must not be active. After an error the viewports may hold anything. TESSERA_ERROR_CALL_ORDER: a
 * framebuffer is incomplete or lacks what it needs. */
TESSERA_API TesseraResult tesseraDraw(TesseraRenderer renderer, const TesseraDrawInfo* info);

#ifdef __cplusplus
}
#endif

#endif /* TESSERA_TESSERA_H_ */
