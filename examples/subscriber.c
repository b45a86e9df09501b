/* Hears one sweep of a running pzctl daemon and prints its numbers, one line each: frequency R X, exactly.
 *
 * cc -o subscriber subscriber.c -lzmq -lcjson && ./subscriber DAEMON.JSON
 *
 * DAEMON.JSON is the file that `pzctl daemon` writes into its data folder: address and key, for its owner alone.
 *
 * For little-endian machines; the raw frames are little-endian doubles. */
#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>
#include <zmq.h>

#define MOST_FRAMES 256

static int receive(void *socket, zmq_msg_t *frames)
{
    int count = 0, more = 1;
    size_t size = sizeof more;
    while (more && count < MOST_FRAMES) {
        zmq_msg_init(&frames[count]);
        if (zmq_msg_recv(&frames[count], socket, 0) < 0)
            return -1;
        count++;
        zmq_getsockopt(socket, ZMQ_RCVMORE, &more, &size);
    }
    return count;
}

/* Returns the frame of a column of this name and type, or NULL where the header names none that fits its frame. */
static const void *column(const cJSON *header, zmq_msg_t *frames, int count, const char *name, const char *dtype,
                          size_t item, size_t *length)
{
    int k = 0;
    const cJSON *one;
    cJSON_ArrayForEach(one, cJSON_GetObjectItem(header, "columns"))
    {
        const cJSON *its_name = cJSON_GetObjectItem(one, "name"), *its_type = cJSON_GetObjectItem(one, "dtype");
        if (2 + k < count && cJSON_IsString(its_name) && cJSON_IsString(its_type) &&
            !strcmp(its_name->valuestring, name) && !strcmp(its_type->valuestring, dtype)) {
            *length = zmq_msg_size(&frames[2 + k]) / item;
            return zmq_msg_data(&frames[2 + k]);
        }
        k++;
    }
    return NULL;
}

static int print_sweep(zmq_msg_t *frames, int count)
{
    cJSON *header = cJSON_ParseWithLength(zmq_msg_data(&frames[1]), zmq_msg_size(&frames[1]));
    size_t points = 0, values = 0;
    const char *f = column(header, frames, count, "frequency", "<f8", 8, &points);
    const char *z = column(header, frames, count, "impedance", "<c16", 16, &values);
    int good = f && z && points == values;
    for (size_t k = 0; good && k < points; k++) {
        double frequency, impedance[2];
        memcpy(&frequency, f + 8 * k, 8); /* a frame need not be aligned */
        memcpy(impedance, z + 16 * k, 16);
        printf("%.17g %.17g %.17g\n", frequency, impedance[0], impedance[1]);
    }
    cJSON_Delete(header);
    return good ? 0 : 1;
}

/* Connects to the daemon that the file names, with the key in it; returns 0, or -1 where that fails. */
static int connect_to(void *events, const char *path)
{
    char text[65536];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(text, 1, sizeof text, file) : 0;
    if (file)
        fclose(file);
    cJSON *where = cJSON_ParseWithLength(text, size), *key = cJSON_GetObjectItem(where, "key");
    const char *endpoint = cJSON_GetStringValue(cJSON_GetObjectItem(where, "events"));
    const char *server = cJSON_GetStringValue(cJSON_GetObjectItem(key, "server"));
    const char *public_key = cJSON_GetStringValue(cJSON_GetObjectItem(key, "public"));
    const char *secret = cJSON_GetStringValue(cJSON_GetObjectItem(key, "secret"));
    int good = endpoint && server && public_key && secret &&
               zmq_setsockopt(events, ZMQ_CURVE_SERVERKEY, server, strlen(server) + 1) == 0 &&
               zmq_setsockopt(events, ZMQ_CURVE_PUBLICKEY, public_key, strlen(public_key) + 1) == 0 &&
               zmq_setsockopt(events, ZMQ_CURVE_SECRETKEY, secret, strlen(secret) + 1) == 0 &&
               zmq_connect(events, endpoint) == 0;
    cJSON_Delete(where);
    return good ? 0 : -1;
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: subscriber DAEMON.JSON\n");
        return 2;
    }
    void *context = zmq_ctx_new(), *events = zmq_socket(context, ZMQ_SUB);
    zmq_setsockopt(events, ZMQ_SUBSCRIBE, "", 0);
    if (connect_to(events, argv[1]) != 0) {
        fprintf(stderr, "%s: no daemon is named there that lets us in\n", argv[1]);
        return 1;
    }
    int status = 1, heard = 0;
    while (!heard) {
        zmq_msg_t frames[MOST_FRAMES];
        int count = receive(events, frames);
        if (count < 0)
            break;
        size_t size = zmq_msg_size(&frames[0]);
        const char *topic = zmq_msg_data(&frames[0]);
        if (size >= 8 && !memcmp(topic, "welcome.", 8))
            fprintf(stderr, "listening\n");
        if (count >= 2 && size >= 6 && !memcmp(topic, "sweep.", 6)) {
            status = print_sweep(frames, count);
            heard = 1;
        }
        while (count > 0)
            zmq_msg_close(&frames[--count]);
    }
    zmq_close(events);
    zmq_ctx_term(context);
    return status;
}
