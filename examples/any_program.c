/* Tell a swarm what a sensor reads, from C, with nothing but Zenoh.
 *
 * Every call is as the headers of zenoh-c 1.x declare it; it was neither linked nor run.
 *
 *   cc any_program.c -o any_program -lzenohc
 *   ./any_program tcp/127.0.0.1:7447 home door on
 */

#include <stdio.h>

#include "zenoh.h"

int main(int argc, char **argv) {
    if (argc != 5) {
        fprintf(stderr, "usage: %s ENDPOINT SWARM SENSOR VALUE\n", argv[0]);
        return 2;
    }
    char endpoints[256], key[256];
    int at = snprintf(endpoints, sizeof endpoints, "[\"%s\"]", argv[1]);
    int of = snprintf(key, sizeof key, "neurosnap/%s/reading/%s", argv[2], argv[3]);
    if (at >= (int)sizeof endpoints || of >= (int)sizeof key) {
        fprintf(stderr, "ENDPOINT, SWARM and SENSOR: must be shorter\n");
        return 2;
    }

    z_owned_config_t config;
    z_config_default(&config);
    if (zc_config_insert_json5(z_loan_mut(config), Z_CONFIG_MODE_KEY, "\"client\"") < 0 ||
        zc_config_insert_json5(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, endpoints) < 0) {
        fprintf(stderr, "ENDPOINT: must be PROTOCOL/ADDRESS, got %s\n", argv[1]);
        return 2;
    }
    z_owned_session_t session;
    if (z_open(&session, z_move(config), NULL) < 0) {
        fprintf(stderr, "swarm: must be reachable at %s\n", argv[1]);
        return 1;
    }
    z_view_keyexpr_t where;
    z_owned_bytes_t payload;
    int failed = z_view_keyexpr_from_str(&where, key) < 0 ||
                 z_bytes_copy_from_str(&payload, argv[4]) < 0 ||
                 z_put(z_loan(session), z_loan(where), z_move(payload), NULL) < 0;
    z_drop(z_move(session));
    if (failed) {
        fprintf(stderr, "SENSOR: must be part of a key that can be put, got %s\n", argv[3]);
    }
    return failed;
}
