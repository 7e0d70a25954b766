// The Kubernetes manifests: each overlay is built by kustomize itself and read strictly into the API's own types, then held
// to what the server needs.
package manifests

import (
	"bytes"
	"os"
	"os/exec"
	"path/filepath"
	"strconv"
	"strings"
	"testing"

	apps "k8s.io/api/apps/v1"
	core "k8s.io/api/core/v1"
	networking "k8s.io/api/networking/v1"
	policy "k8s.io/api/policy/v1"
	"sigs.k8s.io/kustomize/api/krusty"
	"sigs.k8s.io/kustomize/kyaml/filesys"
	"sigs.k8s.io/yaml"
)

type objects map[string]any

func parse(kind string, text []byte) (any, error) {
	types := map[string]func() any{
		"ConfigMap":           func() any { return &core.ConfigMap{} },
		"Deployment":          func() any { return &apps.Deployment{} },
		"NetworkPolicy":       func() any { return &networking.NetworkPolicy{} },
		"PodDisruptionBudget": func() any { return &policy.PodDisruptionBudget{} },
		"ScaledObject":        func() any { return &ScaledObject{} },
		"Secret":              func() any { return &core.Secret{} },
		"Service":             func() any { return &core.Service{} },
		"ServiceAccount":      func() any { return &core.ServiceAccount{} },
	}
	make, known := types[kind]
	if !known {
		return nil, os.ErrNotExist
	}
	object := make()
	return object, yaml.UnmarshalStrict(text, object)
}

// A copy of the tree with credentials, as an operator would put them there.
func manifests(t *testing.T) string {
	t.Helper()
	folder := t.TempDir()
	if err := os.CopyFS(folder, os.DirFS("../../../deploy/kubernetes")); err != nil {
		t.Fatal(err)
	}
	credentials := filepath.Join(folder, "components/secure/credentials")
	os.RemoveAll(credentials)
	if err := os.Mkdir(credentials, 0o700); err != nil {
		t.Fatal(err)
	}
	for _, name := range []string{"tokens", "tls.crt", "tls.key"} {
		if err := os.WriteFile(filepath.Join(credentials, name), []byte("secret "+name), 0o600); err != nil {
			t.Fatal(err)
		}
	}
	store := filepath.Join(folder, "components/store/credentials")
	os.RemoveAll(store)
	if err := os.Mkdir(store, 0o700); err != nil {
		t.Fatal(err)
	}
	text := []byte("MARBLE_STATE=postgresql://marble@db:5432/marble\nPGPASSWORD=secret\n")
	if err := os.WriteFile(filepath.Join(store, "store.env"), text, 0o600); err != nil {
		t.Fatal(err)
	}
	return folder
}

func build(t *testing.T, overlay string) objects {
	t.Helper()
	result, err := krusty.MakeKustomizer(krusty.MakeDefaultOptions()).
		Run(filesys.MakeFsOnDisk(), filepath.Join(manifests(t), "overlays", overlay))
	if err != nil {
		t.Fatal(err)
	}
	found := objects{}
	for _, resource := range result.Resources() {
		text, err := resource.AsYAML()
		if err != nil {
			t.Fatal(err)
		}
		object, err := parse(resource.GetKind(), text)
		if err != nil {
			t.Fatalf("%s %s: %v", resource.GetKind(), resource.GetName(), err)
		}
		if resource.GetNamespace() != "marble" {
			t.Errorf("%s %s is in namespace %q", resource.GetKind(), resource.GetName(), resource.GetNamespace())
		}
		found[resource.GetKind()+" "+strings.SplitN(resource.GetName(), "-config-", 2)[0]] = object
	}
	return found
}

func deployment(t *testing.T, found objects) (*apps.Deployment, core.Container) {
	t.Helper()
	result, ok := found["Deployment marble"].(*apps.Deployment)
	if !ok {
		t.Fatal("there is no Deployment marble")
	}
	return result, result.Spec.Template.Spec.Containers[0]
}

func settings(t *testing.T, found objects) string {
	t.Helper()
	for _, object := range found {
		if config, ok := object.(*core.ConfigMap); ok {
			return config.Data["marble.toml"]
		}
	}
	t.Fatal("there is no ConfigMap")
	return ""
}

func setting(t *testing.T, text, name string) int64 {
	t.Helper()
	for _, line := range strings.Split(text, "\n") {
		if key, value, found := strings.Cut(line, " = "); found && key == name {
			number, err := strconv.ParseInt(strings.TrimSpace(strings.SplitN(value, "#", 2)[0]), 10, 64)
			if err != nil {
				t.Fatal(err)
			}
			return number
		}
	}
	t.Fatalf("marble.toml does not set %s", name)
	return 0
}

var overlays = []string{"small", "production"}

func TestAnUnknownFieldIsAnError(t *testing.T) {
	text := []byte("apiVersion: apps/v1\nkind: Deployment\nspec: {replica: 3}\n")
	if _, err := parse("Deployment", text); err == nil {
		t.Fatal("it was taken")
	}
}

func TestTheServerTakesTheConfiguration(t *testing.T) {
	server := filepath.Join(os.Getenv("MARBLE_BUILD_DIR"), "bin/marble-server")
	for _, overlay := range overlays {
		file := filepath.Join(t.TempDir(), "marble.toml")
		if err := os.WriteFile(file, []byte(settings(t, build(t, overlay))), 0o600); err != nil {
			t.Fatal(err)
		}
		if output, err := exec.Command(server, "--config", file, "--check-config").CombinedOutput(); err != nil {
			t.Errorf("%s: %s", overlay, output)
		}
	}
}

func TestRequestsMatchTheWorkersAndMemoryTheLimits(t *testing.T) {
	for _, overlay := range overlays {
		found := build(t, overlay)
		_, container := deployment(t, found)
		text := settings(t, found)
		workers := setting(t, text, "workers")
		for _, list := range []core.ResourceList{container.Resources.Requests, container.Resources.Limits} {
			if list.Cpu().Value() != workers {
				t.Errorf("%s: %s cores for %d workers", overlay, list.Cpu(), workers)
			}
		}
		most := setting(t, text, "queue_bytes") + setting(t, text, "session_bytes") + setting(t, text, "result_bytes") +
			2*setting(t, text, "transport_bytes") + workers*setting(t, text, "solve_bytes")
		if limit := container.Resources.Limits.Memory().Value(); most > limit*9/10 {
			t.Errorf("%s: the server may take %d of %d bytes", overlay, most, limit)
		}
	}
}

func TestAStopLeavesTimeToBeForgottenAndToDrain(t *testing.T) {
	for _, overlay := range overlays {
		whole, container := deployment(t, build(t, overlay))
		sleep := container.Lifecycle.PreStop.Exec.Command
		seconds, err := strconv.Atoi(sleep[1])
		if err != nil || sleep[0] != "sleep" || seconds < 5 {
			t.Errorf("%s: preStop is %v", overlay, sleep)
		}
		const drain, lastAnswers = 30, 5
		if grace := *whole.Spec.Template.Spec.TerminationGracePeriodSeconds; grace < int64(seconds+drain+lastAnswers+5) {
			t.Errorf("%s: %d s do not suffice", overlay, grace)
		}
		rolling := whole.Spec.Strategy.RollingUpdate
		if rolling.MaxUnavailable.IntValue() != 0 {
			t.Errorf("%s: an update takes servers away before there are new ones", overlay)
		}
	}
}

func TestEverySelectorFindsThePods(t *testing.T) {
	for _, overlay := range overlays {
		found := build(t, overlay)
		whole, _ := deployment(t, found)
		pods := whole.Spec.Template.Labels
		selectors := map[string]map[string]string{
			"Deployment":          whole.Spec.Selector.MatchLabels,
			"Service marble":      found["Service marble"].(*core.Service).Spec.Selector,
			"Service marble-http": found["Service marble-http"].(*core.Service).Spec.Selector,
			"PodDisruptionBudget": found["PodDisruptionBudget marble"].(*policy.PodDisruptionBudget).Spec.Selector.MatchLabels,
			"NetworkPolicy":       found["NetworkPolicy marble"].(*networking.NetworkPolicy).Spec.PodSelector.MatchLabels,
			"spread":              whole.Spec.Template.Spec.TopologySpreadConstraints[0].LabelSelector.MatchLabels,
		}
		for name, selector := range selectors {
			if len(selector) == 0 {
				t.Errorf("%s: %s selects every pod of the namespace", overlay, name)
			}
			for key, value := range selector {
				if pods[key] != value {
					t.Errorf("%s: %s looks for %s=%s", overlay, name, key, value)
				}
			}
		}
	}
}

func TestClientsCanBalanceAndTheNetworkIsClosedButForThem(t *testing.T) {
	found := build(t, "small")
	service := found["Service marble"].(*core.Service)
	if service.Spec.ClusterIP != core.ClusterIPNone || service.Spec.PublishNotReadyAddresses {
		t.Error("the Service is not headless, or names pods that are not ready")
	}
	rules := found["NetworkPolicy marble"].(*networking.NetworkPolicy).Spec
	if len(rules.PolicyTypes) != 2 || len(rules.Egress) != 0 {
		t.Error("a server can call somebody")
	}
	for _, rule := range rules.Ingress {
		if len(rule.From) == 0 || len(rule.Ports) == 0 {
			t.Error("a rule lets everybody in, or to every port")
		}
	}
}

func TestPortsAreNamedAsTheyAreUsed(t *testing.T) {
	for _, overlay := range overlays {
		found := build(t, overlay)
		_, container := deployment(t, found)
		names := map[string]bool{}
		for _, port := range container.Ports {
			names[port.Name] = true
		}
		for _, probe := range []*core.Probe{container.StartupProbe, container.ReadinessProbe, container.LivenessProbe} {
			if !names[probe.HTTPGet.Port.StrVal] {
				t.Errorf("%s: a probe asks port %s", overlay, probe.HTTPGet.Port.String())
			}
		}
		for _, name := range []string{"Service marble", "Service marble-http"} {
			if port := found[name].(*core.Service).Spec.Ports[0].TargetPort.StrVal; !names[port] {
				t.Errorf("%s: %s goes to port %s", overlay, name, port)
			}
		}
	}
}

func TestAPodCanDoLittleElse(t *testing.T) {
	for _, overlay := range overlays {
		whole, container := deployment(t, build(t, overlay))
		pod, own := whole.Spec.Template.Spec, container.SecurityContext
		if !*pod.SecurityContext.RunAsNonRoot || pod.SecurityContext.SeccompProfile.Type != core.SeccompProfileTypeRuntimeDefault ||
			*pod.AutomountServiceAccountToken || *own.AllowPrivilegeEscalation || !*own.ReadOnlyRootFilesystem ||
			len(own.Capabilities.Drop) != 1 || own.Capabilities.Drop[0] != "ALL" {
			t.Errorf("%s: %+v", overlay, own)
		}
	}
}

func TestAFleetHasItsStoreFromASecretAndMayReachIt(t *testing.T) {
	found := build(t, "fleet")
	whole, container := deployment(t, found)
	if whole.Spec.Replicas == nil || *whole.Spec.Replicas != 3 {
		t.Error("it has not three servers")
	}
	if len(container.EnvFrom) != 1 || container.EnvFrom[0].SecretRef == nil {
		t.Fatalf("its environment is from %+v", container.EnvFrom)
	}
	name, known := container.EnvFrom[0].SecretRef.Name, false
	for _, object := range found {
		if secret, ok := object.(*core.Secret); ok && secret.Name == name {
			known = bytes.HasPrefix(secret.Data["MARBLE_STATE"], []byte("postgresql://")) && len(secret.Data["PGPASSWORD"]) > 0
		}
	}
	if !known {
		t.Errorf("there is no Secret %s with the store", name)
	}
	policy := found["NetworkPolicy marble"].(*networking.NetworkPolicy)
	if len(policy.Spec.Egress) == 0 || policy.Spec.Egress[0].Ports[0].Port.IntValue() != 5432 {
		t.Errorf("it may reach %+v", policy.Spec.Egress)
	}
}

func TestProductionEncryptsKnowsCallersAndScales(t *testing.T) {
	found := build(t, "production")
	whole, container := deployment(t, found)
	arguments := strings.Join(container.Args, " ")
	for _, wanted := range []string{"--insecure=false", "--allow-anonymous=false", "--tls-certificate=", "--tls-key=", "--tokens="} {
		if !strings.Contains(arguments, wanted) {
			t.Errorf("%s is missing", wanted)
		}
	}
	var mounted string
	for _, volume := range whole.Spec.Template.Spec.Volumes {
		if volume.Secret != nil {
			mounted = volume.Secret.SecretName
		}
	}
	var secret *core.Secret
	for _, object := range found {
		if one, ok := object.(*core.Secret); ok {
			secret = one
		}
	}
	if secret == nil || secret.Name != mounted || !bytes.Equal(secret.Data["tls.key"], []byte("secret tls.key")) {
		t.Errorf("the pods mount %q", mounted)
	}
	for _, probe := range []*core.Probe{container.StartupProbe, container.ReadinessProbe, container.LivenessProbe} {
		if probe.HTTPGet.Scheme != core.URISchemeHTTPS || probe.HTTPGet.Path == "" {
			t.Error("a probe does not speak TLS")
		}
	}
	scaled := found["ScaledObject marble"].(*ScaledObject)
	if scaled.Spec.ScaleTargetRef.Name != whole.Name || scaled.Spec.MinReplicaCount < 2 {
		t.Error("nothing, or too little, is scaled")
	}
	for _, trigger := range scaled.Spec.Triggers {
		if !strings.Contains(trigger.Metadata["query"], "marble_") {
			t.Errorf("%s asks for %s", trigger.Name, trigger.Metadata["query"])
		}
	}
}
