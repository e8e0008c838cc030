/*
 * Random calls of every function with what no careful program would give it: NULL, NaN, infinities, texts that are no names, counts
 * that do not fit, damaged bytes. It ends with exit code 1 where a call that failed has moved the estimate, an estimate is not finite, a
 * status is none, or a failure has no message. Built with -fsanitize=address,undefined it finds the rest.
 *
 *     random_calls SEED COUNT
 */
#include "bottomlock.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POOL = 4, MANY = 64, BYTES = 1 << 20 };

static uint64_t state = 1;
static unsigned long long calls, failures;
static const char *called = "";

static uint64_t draw(void) { /* xorshift64* */
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * UINT64_C(2685821657736338717);
}
static unsigned below(unsigned limit) { return (unsigned)((draw() >> 33) % limit); }
static int one_in(unsigned chances) { return below(chances) == 0; }
static double uniform(void) { return (double)(draw() >> 11) * 0x1p-53; }

static double wild(void) {
    static const double numbers[] = {0.0, -0.0, 1.0, -1.0, 0.5, 1e-9, 0.02, 9.81, -9.81, 50.0, 1e6, 1e12, 1e300, -1e300, 5e-324};
    switch (below(20)) {
    case 0: return NAN;
    case 1: return INFINITY;
    case 2: return -INFINITY;
    default: return numbers[below(sizeof numbers / sizeof *numbers)];
    }
}
/* Mostly a number about a given one. */
static double about(double mean, double spread) { return one_in(40) ? wild() : mean + spread * (2.0 * uniform() - 1.0); }

static double numbers[400];
static const double *some(unsigned count, double mean, double spread) {
    static double kept[8][400];
    static unsigned next;
    double *values = kept[next++ % 8];
    if (one_in(60)) return NULL;
    for (unsigned k = 0; k < count; k++) values[k] = about(mean, spread);
    return values;
}
static const uint8_t *flags(void) {
    static uint8_t kept[MANY];
    if (one_in(60)) return NULL;
    for (unsigned k = 0; k < 16; k++) kept[k] = (uint8_t)(one_in(5) ? 0 : below(256));
    return kept;
}
static const double *quaternion(void) {
    static double kept[4];
    const double yaw = 3.0 * uniform();
    if (one_in(30)) return some(4, 0.0, 1.0);
    kept[0] = cos(yaw / 2);
    kept[1] = kept[2] = 0.0;
    kept[3] = sin(yaw / 2);
    return kept;
}
static const char *word(const char *(*names)(size_t)) {
    static const char *odd[] = {"", "\xff\xfe", "gaate", "x", "+", "joint", "off", "averaged", "inflate", "huber", "ellipsoid", "tc",
                                "sway_current", "weak_sway", "least_squares", "selector", "virtual_beam", "information", "table_2"};
    if (one_in(40)) return NULL;
    if (names != NULL && !one_in(5)) {
        size_t count = 0;
        while (names(count) != NULL) count++;
        return names(below((unsigned)count));
    }
    return odd[below(sizeof odd / sizeof *odd)];
}

static void die(const char *why) {
    fprintf(stderr, "%s: %s after %llu calls: %s\n", called, why, calls, bl_last_error());
    exit(1);
}
static bl_status judged(const char *name, bl_status status) {
    called = name;
    calls++;
    if ((int)status < 0 || (int)status >= BL_STATUS_INTERNAL) die("no status, or an internal error");
    if (status != BL_STATUS_OK) {
        failures++;
        if (bl_last_error()[0] == '\0' || bl_last_status() != status) die("a failure without its message");
    }
    return status;
}
#define CALL(function, ...) judged(#function, function(__VA_ARGS__))
/* Puts what a call has made into a pool. */
#define MADE(pool, kind, function, ...)                                                                                          \
    do {                                                                                                                         \
        kind *made = function(__VA_ARGS__);                                                                                      \
        const unsigned place = below(POOL);                                                                                      \
        judged(#function, made == NULL ? bl_last_status() : BL_STATUS_OK);                                                       \
        if (made == NULL && bl_last_status() == BL_STATUS_OK) die("no object and no status");                                    \
        if (made != NULL) {                                                                                                      \
            kind##_free(pool[place]);                                                                                            \
            pool[place] = made;                                                                                                  \
        }                                                                                                                        \
    } while (0)

static bl_geometry *geometries[POOL];
static bl_model *models[POOL];
static bl_options *options[POOL];
static bl_navigator *navigators[POOL];

/* Beams in one of the ways of the header, and a mounting. */
static const char *beams(char *text) {
    static const char *forms[] = {
        "{\"configuration\": \"x\", \"tilt_rad\": %.17g, \"roll_pitch_yaw_rad\": [%.17g, 0, 0]}",
        "{\"tilts_rad\": [%.17g, 0.4, 0.4], \"azimuths_rad\": [0, 2, 4], \"lever_arms_p_m\": [[%.17g, 0, 0], [0, 0, 0], [1, 0, 0]]}",
        "{\"directions_d\": [[0.3, 0.3, 0.9055385138137417], [0, 0, 1]], \"roll_pitch_yaw_rad\": [%.17g, %.17g, 0]}",
        "{\"preset\": \"x_janus_20\", \"sound_speed_scale\": %.17g, \"lever_arms_p_m\": [[%.17g]]}",
    };
    if (one_in(20)) return word(NULL);
    if (one_in(4)) snprintf(text, 400, "{\"preset\": \"%s\"}", bl_geometry_preset_name(below(7)));
    else snprintf(text, 400, forms[below(4)], about(0.4, 0.3), about(0.0, 0.5));
    return text;
}

static void geometry_calls(void) {
    char text[400];
    if (one_in(2)) MADE(geometries, bl_geometry, bl_geometry_from_json, beams(text));
    else CALL(bl_geometry_direction, geometries[below(POOL)], below(9), one_in(9) ? NULL : numbers);
}

/* A change of one key: a number or three, seldom no JSON. */
static const char *setting(char *text, const char *section, const char *key) {
    if (one_in(20)) return word(NULL);
    const double value = one_in(3) ? wild() : about(0.1, 0.1);
    const char *form = one_in(2) ? "{\"%s\": {\"%s\": %.17g}}" : "{\"%s\": {\"%s\": [%.17g, 0.1, 0.1]}}";
    snprintf(text, 6000, form, section, key, value);
    return text;
}

static void settings_calls(void) {
    bl_model *model = models[below(POOL)];
    bl_options *chosen = options[below(POOL)];
    size_t size;
    char text[6000];
    switch (below(10)) {
    case 0:
        snprintf(text, sizeof text, "{\"preset\": \"%s\", \"latitude_rad\": %.17g}", bl_model_preset_name(below(7)), about(0.5, 0.5));
        MADE(models, bl_model, bl_model_from_json, one_in(20) ? word(NULL) : text);
        break;
    case 1: CALL(bl_model_set, model, setting(text, "initial", "velocity_sd_mps")); break;
    case 2: CALL(bl_model_set, model, setting(text, "dvl", "beam_noise_sd_mps")); break;
    case 3: CALL(bl_model_to_json, model, text, one_in(3) ? below(3000) : sizeof text, one_in(9) ? NULL : &size); break;
    case 4:
        if (bl_model_to_json(model, text, sizeof text, &size) != BL_STATUS_OK) break;
        text[below((unsigned)size)] = one_in(3) ? '0' : text[0];
        MADE(models, bl_model, bl_model_from_json, text);
        break;
    case 5: MADE(options, bl_options, bl_options_from_json, one_in(2) ? "{}" : word(NULL)); break;
    case 6: CALL(bl_options_set, chosen, below(2) ? "{\"water_track\": true}" : "{\"water_track\": false}"); break;
    case 7: CALL(bl_options_set, chosen, setting(text, "current_layers", "sd_mps")); break;
    case 8: CALL(bl_options_set, chosen, setting(text, "levers", "depth_p_m")); break;
    default: CALL(bl_options_to_json, chosen, text, one_in(3) ? below(3000) : sizeof text, one_in(9) ? NULL : &size); break;
    }
}

static int finite_state(const bl_state *now) {
    const double *values = now->position_t_m;
    for (size_t k = 0; k < (sizeof *now - offsetof(bl_state, position_t_m)) / sizeof(double); k++)
        if (!isfinite(values[k])) return 0;
    return 1;
}

static void push_calls(void) {
    bl_navigator *to = navigators[below(POOL)];
    bl_state before, after;
    memset(&before, 0, sizeof before);
    memset(&after, 0, sizeof after);
    const int known = to != NULL && bl_navigator_state(to, &before) == BL_STATUS_OK;
    const int64_t now = known ? before.time_ns : 0;
    int64_t time = one_in(50) ? (int64_t)draw() : now + (int64_t)(2e8 * (uniform() - 0.5));
    size_t taken = 0;
    bl_status status = BL_STATUS_OK;
    switch (below(18)) {
    case 0: {
        int64_t times[MANY];
        static double rates[3 * MANY], forces[3 * MANY];
        for (unsigned k = 0; k < MANY; k++) {
            times[k] = now + (k + 1) * INT64_C(10000000);
            for (unsigned axis = 0; axis < 3; axis++) {
                rates[3 * k + axis] = about(0.0, 0.02);
                forces[3 * k + axis] = about(axis == 2 ? -9.8 : 0.0, 0.2);
            }
        }
        status = CALL(bl_push_imu_block, to, below(MANY + 1), one_in(60) ? NULL : times, rates, forces, &taken);
        if (taken > 0) status = BL_STATUS_OK; /* the readings before the refused one move the estimate */
        break;
    }
    case 1: status = CALL(bl_push_beams, to, time, known ? 4 : below(9), some(8, 0.3, 0.3), flags(), some(8, 0.05, 0.04)); break;
    case 2: status = CALL(bl_push_beams, to, time, below(9), some(8, 0.3, 0.3), flags(), some(8, 0.05, 0.04)); break;
    case 3: status = CALL(bl_push_water_track, to, time, 4, some(8, 0.3, 0.3), flags(), some(8, 0.05, 0.04), about(5.0, 4.0)); break;
    case 4: {
        double covariance[9] = {0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01};
        if (one_in(4)) covariance[below(9)] = wild();
        status = CALL(bl_push_velocity, to, time, some(3, 0.5, 0.5), one_in(60) ? NULL : covariance);
        break;
    }
    case 12: status = CALL(bl_push_thrust, to, time, some(3, 1.0, 1.0), about(0.1, 0.05)); break;
    case 5: status = CALL(bl_push_depth, to, time, about(3.0, 3.0), about(0.1, 0.05)); break;
    case 6: status = CALL(bl_push_attitude, to, time, quaternion(), about(0.02, 0.01), about(0.05, 0.02)); break;
    case 7: status = CALL(bl_push_heading, to, time, about(0.0, 1.0), about(0.1, 0.05)); break;
    case 8: status = CALL(bl_push_gps, to, time, some(3, 0.0, 5.0), some(3, 2.0, 1.0), some(3, 0.0, 1.0), some(3, 0.2, 0.1)); break;
    case 9: status = CALL(bl_push_gps, to, time, some(3, 0.0, 5.0), some(3, 2.0, 1.0), NULL, NULL); break;
    case 10: status = CALL(bl_push_acoustic_position, to, time, some(3, 0.0, 5.0), one_in(2) ? NULL : some(3, 2.0, 1.0)); break;
    default: {
        const double omega[3] = {about(0.0, 0.02), about(0.0, 0.02), about(0.0, 0.05)};
        const double force[3] = {about(0.0, 0.2), about(0.0, 0.2), about(-9.8, 0.2)};
        if (!one_in(20)) time = now + 10000000;
        status = CALL(bl_push_imu, to, time, one_in(99) ? NULL : omega, force);
        break;
    }
    }
    if (!known || bl_navigator_state(to, &after) != BL_STATUS_OK) return;
    if (!finite_state(&after)) die("a state that is not finite");
    if (status != BL_STATUS_OK && memcmp(&before, &after, sizeof before) != 0) die("a refused push moved the estimate");
}

static void navigator_calls(void) {
    static uint8_t bytes[BYTES];
    bl_navigator *of = navigators[below(POOL)];
    bl_report report;
    bl_water water;
    bl_layer layers[MANY];
    bl_calibration calibration;
    bl_velocity velocity;
    uint64_t counts[32];
    size_t count = 0;
    switch (below(17)) {
    case 15: {
        char geometry[400], text[1000];
        const char *given = beams(geometry);
        snprintf(text, sizeof text,
                 "{\"geometry\": %s, \"model\": {\"preset\": \"tactical\", \"latitude_rad\": %.17g}, \"start\": {\"dvl_scale_factor\": %.17g}}",
                 given == NULL ? "null" : given, about(0.5, 0.5), about(0.0, 0.01));
        if (one_in(9)) text[below(100)] = '"';
        MADE(navigators, bl_navigator, bl_navigator_from_json, one_in(60) ? NULL : text);
        break;
    }
    case 0:
    case 1: {
        bl_state start = bl_state_at_rest(one_in(9) ? (int64_t)draw() : 0);
        if (one_in(4)) start.velocity_p_mps[below(3)] = wild();
        if (one_in(9)) start.attitude_t_p[below(4)] = wild();
        MADE(navigators, bl_navigator, bl_navigator_new, geometries[below(POOL)], models[below(POOL)],
             one_in(3) ? NULL : options[below(POOL)], one_in(2) ? "sway_current" : word(bl_method_name), one_in(60) ? NULL : &start,
             one_in(20) ? (int64_t)draw() : -1);
        break;
    }
    case 2: MADE(navigators, bl_navigator, bl_navigator_copy, of); break;
    case 3: {
        double covariance[400] = {0};
        for (unsigned k = 0; k < 20; k++) covariance[21 * k] = about(0.01, 0.009);
        if (one_in(3)) covariance[below(400)] = wild();
        if (of != NULL && !one_in(3)) bl_navigator_covariance(of, covariance);
        CALL(bl_navigator_set_covariance, of, one_in(20) ? NULL : covariance);
        break;
    }
    case 4:
        if (CALL(bl_navigator_covariance, of, numbers) == BL_STATUS_OK)
            for (unsigned k = 0; k < 400; k++)
                if (!isfinite(numbers[k])) die("a covariance that is not finite");
        break;
    case 5: CALL(bl_navigator_late_events, of, counts, below(33), &count); break;
    case 6: CALL(bl_navigator_imu_faults, of, counts, below(33), one_in(9) ? NULL : &count); break;
    case 7: CALL(bl_navigator_discard_waiting, of, one_in(2) ? NULL : &count); break;
    case 8: {
        bl_status saved = CALL(bl_navigator_save, of, bytes, one_in(9) ? below(300) : BYTES, &count);
        if (saved != BL_STATUS_OK || count > BYTES) break;
        if (one_in(2)) bytes[below((unsigned)count)] ^= (uint8_t)(1u << below(8));
        MADE(navigators, bl_navigator, bl_navigator_load, bytes, one_in(4) ? below((unsigned)count) : count);
        break;
    }
    case 9: CALL(bl_report_get, of, below(3), &report); break;
    case 10:
        for (size_t k = 0; k < bl_report_count(of); k++) {
            if (CALL(bl_report_get, of, k, &report) != BL_STATUS_OK) die("a report that is not there");
            if (report.rows > BL_MAX_ROWS || !isfinite(report.nis) || strlen(report.sensor) == 0) die("a report that is none");
        }
        break;
    case 11: CALL(bl_navigator_water, of, one_in(9) ? NULL : &water); break;
    case 12: CALL(bl_navigator_layers, of, layers, below(MANY), &count); break;
    case 13: CALL(bl_navigator_calibration, of, &calibration); break;
    case 14: CALL(bl_navigator_attitude_error, of, numbers, one_in(9) ? NULL : numbers + 3); break;
    default:
        CALL(bl_solve_velocity, geometries[below(POOL)], word(NULL), one_in(4) ? below(9) : 4, some(8, 0.3, 0.3), flags(),
             some(8, 0.05, 0.04), one_in(2) ? NULL : some(3, 0.5, 0.5), one_in(2) ? NULL : some(9, 0.1, 0.1),
             one_in(2) ? NULL : some(3, 0.0, 0.1), one_in(2) ? NULL : options[below(POOL)], one_in(60) ? NULL : &velocity);
        break;
    }
}

static void small_calls(void) {
    switch (below(8)) {
    case 0: CALL(bl_attitude_from_euler, about(0.0, 3.0), about(0.0, 1.5), about(0.0, 3.0), one_in(9) ? NULL : numbers); break;
    case 1: CALL(bl_euler_from_attitude, quaternion(), one_in(9) ? NULL : numbers); break;
    case 2: CALL(bl_navigator_heading_error, navigators[below(POOL)], numbers, numbers + 1); break;
    case 3: CALL(bl_push_beams, navigators[below(POOL)], 0, SIZE_MAX, NULL, NULL, NULL); break;
    case 4: CALL(bl_push_imu_block, navigators[below(POOL)], SIZE_MAX, NULL, NULL, NULL, NULL); break;
    case 5: judged("bl_navigator_load", bl_navigator_load(NULL, SIZE_MAX) == NULL ? bl_last_status() : BL_STATUS_INTERNAL); break;
    case 6: /* back to what works, so that settings do not end all wild */
        for (unsigned k = 0; k < POOL; k++) {
            bl_options_free(options[k]);
            options[k] = bl_options_from_json("{}");
            bl_model_free(models[k]);
            models[k] = bl_model_from_json("{\"preset\": \"tactical\", \"latitude_rad\": 0.5}");
            bl_geometry_free(geometries[k]);
            geometries[k] = bl_geometry_from_json("{\"preset\": \"x_janus_20\"}");
        }
        break;
    default:
        if (bl_stream_name(below(40)) != NULL && bl_version()[0] == '\0') die("no version");
        bl_navigator_free(NULL);
        break;
    }
}

int main(int argc, char **argv) {
    if (argc != 3) return fprintf(stderr, "usage: random_calls SEED COUNT\n"), 2;
    state = strtoull(argv[1], NULL, 10) * 2 + 1;
    const unsigned long long count = strtoull(argv[2], NULL, 10);
    while (calls < count) {
        switch (below(40)) {
        case 0: geometry_calls(); break;
        case 1:
        case 2: settings_calls(); break;
        case 3:
        case 4: navigator_calls(); break;
        case 5: small_calls(); break;
        default: push_calls(); break;
        }
    }
    for (unsigned k = 0; k < POOL; k++) {
        bl_geometry_free(geometries[k]);
        bl_model_free(models[k]);
        bl_options_free(options[k]);
        bl_navigator_free(navigators[k]);
    }
    printf("%llu calls, %llu of them refused\n", calls, failures);
    return 0;
}
