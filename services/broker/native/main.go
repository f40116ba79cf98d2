// The embedded MQTT broker: mochi-mqtt with gemelo's listener, users, ACL, take-over and persistence.
//
// services/broker/embedded.py starts it. It writes nothing to a disk but its log on stderr and, where it was given one,
// the persistence file.
package main

import (
	"crypto/tls"
	"flag"
	"fmt"
	"io"
	"log/slog"
	"math"
	"os"
	"os/signal"
	"runtime/debug"
	"syscall"
	"time"

	mqtt "github.com/mochi-mqtt/server/v2"
)

const (
	memoryLimit = 128 << 20       // [bytes] above which garbage is collected at once; the unit of a host ends it at 256 MiB
	largest     = 256 << 10       // [bytes] of a packet; the largest chunk has 8,228
	queue       = 1024            // messages that one client may have unacknowledged, or waiting while it is away
	closingTime = 2 * time.Second // for the last packets to the clients
)

type options struct {
	listen, users, acl, certificate, key, persistence string
}

func main() {
	if err := run(parse()); err != nil {
		logLine("ERROR", "%v", err)
		os.Exit(1)
	}
}

func parse() options {
	var o options
	flag.StringVar(&o.listen, "listen", "127.0.0.1:1883", "host:port")
	flag.StringVar(&o.users, "users", "", "users and hashed passwords, as mosquitto_passwd writes them; empty: everybody")
	flag.StringVar(&o.acl, "acl", "", "topics of each user, in mosquitto's form")
	flag.StringVar(&o.certificate, "certificate", "", "PEM file of the certificate for TLS; empty: no TLS")
	flag.StringVar(&o.key, "key", "", "PEM file of its private key")
	flag.StringVar(&o.persistence, "persistence", "", "file of sessions and retained messages; empty: none is kept")
	flag.Parse()
	return o
}

// run serves until SIGTERM or SIGINT.
func run(o options) error {
	debug.SetMemoryLimit(memoryLimit)
	stop := make(chan os.Signal, 1)
	signal.Notify(stop, syscall.SIGTERM, syscall.SIGINT)
	security, err := tlsOf(o)
	if err != nil {
		return err
	}
	access, err := readAccess(o.users, o.acl)
	if err != nil {
		return err
	}
	server := mqtt.New(serverOptions())
	sessions := newSessions(server)
	hooks := []mqtt.Hook{access, sessions}
	var store *store
	if o.persistence != "" {
		store = newStore(server, o.persistence, sessions)
		hooks = append(hooks, store)
	}
	for _, hook := range hooks {
		if err := server.AddHook(hook, nil); err != nil {
			return err
		}
	}
	if err := server.AddListener(newListener(o.listen, security, sessions)); err != nil {
		return fmt.Errorf("cannot listen on %s: %w; remedy: another mqtt.port, or end what has it", o.listen, err)
	}
	if err := server.Serve(); err != nil {
		return err
	}
	<-stop
	closeServer(server)
	if store != nil {
		store.save()
	}
	return nil
}

// closeServer disconnects every client; one that does not take its last packet is left behind.
func closeServer(server *mqtt.Server) {
	closed := make(chan struct{})
	go func() {
		_ = server.Close()
		close(closed)
	}()
	select {
	case <-closed:
	case <-time.After(closingTime):
	}
}

func serverOptions() *mqtt.Options {
	can := mqtt.NewDefaultServerCapabilities()
	can.MaximumPacketSize = largest
	can.MaximumInflight, can.ReceiveMaximum, can.MaximumClientWritesPending = queue, queue, queue
	can.MaximumMessageExpiryInterval = 0 // else a retained message would be gone after a day
	can.TopicAliasMaximum = 0            // an ACL is asked before an alias is replaced by its topic
	can.Compatibilities.NoInheritedPropertiesOnAck = true
	return &mqtt.Options{
		Capabilities:           can,
		SysTopicResendInterval: math.MaxInt32, // nobody reads $SYS, and its figures stop the program for a moment
		// What the library says of single packets is not for a person, and it quotes their content.
		Logger: slog.New(slog.NewTextHandler(io.Discard, nil)),
	}
}

func tlsOf(o options) (*tls.Config, error) {
	if o.certificate == "" {
		return nil, nil
	}
	pair, err := tls.LoadX509KeyPair(o.certificate, o.key)
	if err != nil {
		return nil, fmt.Errorf("the certificate %s and its key %s cannot be used: %w; remedy: gemelo broker secure", o.certificate, o.key, err)
	}
	return &tls.Config{Certificates: []tls.Certificate{pair}, MinVersion: tls.VersionTLS12}, nil
}

// logLine writes a line in the form of all processes of the stack.
func logLine(level, format string, values ...any) {
	fmt.Fprintf(os.Stderr, "%s broker %s %s\n", time.Now().Format("15:04:05.000"), level, fmt.Sprintf(format, values...))
}
